"""A text table of any length as the pieces of a motion log, so that only a piece of it is held at a time.

Each piece is read by the one synchroniser, with some rows before and behind it that are then cut off; units and time
are told once, by the first rows.
"""

import math
import re
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.import_formats.csv_files import Block, joined
from catenary.recording.import_formats.importer import NoRowError, columns_wanted, synchronise
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_files import stream_of_text
from catenary.recording.import_formats.table_time import time_of
from catenary.robots.model import RobotModel

MOST_NUMBERS = 3_000_000  # of a piece
_COUNTS = re.compile(r"\d+ of \d+ |\(s\)|\d repeated|\d messages|\d rows")  # in a note that is of a piece's rows
OVERLAP = 10_000  # rows before and behind a piece: of an encoder at a hundredth of the rate a hundred samples


def pieces_of(sources: Sources, mapping: RecordingMapping, model: RobotModel | None = None) -> Iterator[MotionLog]:
    """Yield the log of a recording, piece after piece; whole where it is no long text table.

    Notes of a piece are those of all before it, too. Whole turns and time go on from one piece to the next.
    """
    table = sources.long_text
    optional = any(part is not None and part.optional for part in (mapping.qd, mapping.tau, *mapping.signals.values()))
    pose = None if mapping.q_encoder is None else mapping.q_encoder.pose
    registers = pose is not None and None in (pose.T_base_tracker, pose.T_marker_frame)
    if table is None or optional or registers:  # a piece may have what another lacks, or be registered elsewhere
        yield synchronise(sources, mapping, model=model).log
        return
    sample = sources.streams[0]
    time = time_of(sample, mapping.time, mapping.time_unit, mapping.rate_hz)
    if time is not None and time.column:
        mapping = mapping.model_copy(update={"time": (time.column,), "time_unit": time.unit})
    said: dict[str, dict[str, None]] = {}  # notes, by what they say but for numbers
    told = f"{sample.name}: time is "
    if time is not None:
        said[told] = {f"{sample.name}: {time.said}": None}
    before: tuple[MotionLog, NDArray[np.int64]] | None = None
    measured = repeated = 0
    for first, last, begin, columns in _windows(table.blocks(columns_wanted(sources, mapping))):
        stream = stream_of_text(table.table, columns)
        where = f"rows {begin + 1} to {begin + stream.rows}: "
        try:
            found = synchronise(sources.holding(stream), mapping, model=model, is_piece=True)
        except NoRowError as error:
            said.setdefault(_shape(str(error)), {})[where + str(error)] = None
            continue
        log, rows = found.log, found.rows + begin
        log = log if before is None else _going_on(log, rows, *before)
        before = (log, rows)
        inside = np.flatnonzero((rows >= first) & (rows < last))
        if not len(inside):
            continue
        for note in [note for note in log.notes if not note.startswith(told)]:
            said.setdefault(_shape(note), {})[where + note if _COUNTS.search(note) else note] = None
        measured, repeated = measured + int(log.ok[inside].sum()), repeated + log.repeated
        piece = log.part(int(inside[0]), int(inside[-1]) + 1)
        yield replace(piece, notes=tuple(map(_in_words, said.values())), repeated=repeated)
    if before is None or (before[0].q_encoder is not None and not measured):
        raise InputError("; ".join([f"{sources.paths[0]}: no usable row", *map(_in_words, said.values())]))


def _windows(blocks: Iterator[Block]) -> Iterator[tuple[int, int, int, Block]]:
    """Yield first and last row of a piece, and its columns from some rows before it on, whose first row that is."""
    held: list[Block] = []
    first = begin = count = 0
    for block in blocks:
        held.append(block)
        count += len(next(iter(block.values()), ()))
        size = max(2 * OVERLAP, MOST_NUMBERS // max(1, len(block)))
        while count >= first + size + OVERLAP:
            columns = joined(held)
            yield first, first + size, begin, {n: v[: first + size + OVERLAP - begin] for n, v in columns.items()}
            first, kept = first + size, first + size - OVERLAP
            held, begin = [{name: values[kept - begin :].copy() for name, values in columns.items()}], kept
    if count > first:
        yield first, count, begin, joined(held)


def _going_on(log: MotionLog, rows: NDArray[np.int64], before: MotionLog, its: NDArray[np.int64]) -> MotionLog:
    """Return a piece whose time and whole turns go on from those of the piece before, by a row that both have."""
    shared, here, there = np.intersect1d(rows, its, return_indices=True)
    if not len(shared):
        return log if log.time is None else replace(log, time=log.time + (log.began - before.began), began=before.began)
    i, j = here[-1], there[-1]
    changes: dict[str, Any] = {"began": before.began}
    if log.time is not None and before.time is not None:
        changes["time"] = log.time + (before.time[j] - log.time[i])
    for key in ("q_nominal", "q_encoder", "q_reported"):
        own: Floats | None = getattr(log, key)
        other: Floats | None = getattr(before, key)
        if own is not None and other is not None and np.isfinite(own[i] - other[j]).all():
            turns = np.round((other[j] - own[i]) / math.tau) * (np.array(log.joint_units) == "rad")
            changes[key] = own + turns * math.tau
    return replace(log, **changes)


def _in_words(alike: Collection[str]) -> str:
    """Return the first of notes that differ in numbers, and in how many pieces they are."""
    more = f"; likewise in {len(alike) - 1} more pieces, which overlap by {2 * OVERLAP} rows" if len(alike) > 1 else ""
    return next(iter(alike)) + more


def _shape(note: str) -> str:
    """Return a note without its numbers: what pieces say alike."""
    return re.sub(r"\d[\d.,e+-]*", "#", note)
