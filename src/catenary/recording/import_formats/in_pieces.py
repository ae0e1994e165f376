"""A bag or text table of any length as the pieces of a motion log, so that only a piece of it is held at a time.

Each piece is read by the one synchroniser, with some rows before and behind it that are then cut off; units and time
are told once, by a sample.
"""

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.import_formats.importer import NoRowError, columns_wanted, synchronise
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_time import time_of
from catenary.robots.model import RobotModel

MOST_NUMBERS = 1_500_000  # of a piece
_COUNTS = re.compile(r"\d+ of \d+ |\(s\)|\d repeated|\d messages|\d rows")  # in a note that is of a piece's rows
OVERLAP = 10_000  # rows before and behind a piece: of an encoder at a hundredth of the rate a hundred samples


def pieces_of(sources: Sources, mapping: RecordingMapping, model: RobotModel | None = None) -> Iterator[MotionLog]:
    """Yield a recording's log piece after piece, with all notes so far; whole where short, or no bags nor long text."""
    pose = None if mapping.q_encoder is None else mapping.q_encoder.pose
    registers = pose is not None and None in (pose.T_base_tracker, pose.T_marker_frame)
    if registers or not sources.is_in_parts:  # a piece would be registered elsewhere than another
        yield synchronise(sources, mapping, model=model).log
        return
    wanted = columns_wanted(sources, mapping)
    said: dict[str, dict[str, None]] = {}  # notes, by what they say but for numbers
    told = ""
    sample = sources.streams[0]
    if sample.type == "table":
        time = time_of(sample, mapping.time, mapping.time_unit, mapping.rate_hz)
        if time is not None and time.column:
            mapping = mapping.model_copy(update={"time": (time.column,), "time_unit": time.unit})
        if time is not None:
            told = f"{sample.name}: time is "
            said[told] = {f"{sample.name}: {time.said}": None}
    before: tuple[MotionLog, Integers] | None = None
    measured = repeated = 0
    for first, last, begin, streams in _windows(sources.parts(wanted), wanted):
        piece = sources.holding(streams)
        if first == begin == 0 and last is None:
            piece.notes += sources.problems
            yield synchronise(piece, mapping, model=model).log
            return
        where = f"rows {begin + 1} to {begin + streams[0].rows}: "
        try:
            found = synchronise(piece, mapping, model=model, is_piece=True)
        except NoRowError as error:
            said.setdefault(_shape(str(error)), {})[where + str(error)] = None
            continue
        log, rows = found.log, found.rows + begin
        log = log if before is None else _going_on(log, rows, *before)
        before = (log, rows)
        inside = np.flatnonzero((rows >= first) & (rows < (np.inf if last is None else last)))
        if not len(inside):
            continue
        for note in [note for note in log.notes if not told or not note.startswith(told)]:
            said.setdefault(_shape(note), {})[where + note if _COUNTS.search(note) else note] = None
        measured, repeated = measured + int(log.ok[inside].sum()), repeated + log.repeated
        notes = (*map(_in_words, said.values()), *sources.problems)
        yield replace(log.part(int(inside[0]), int(inside[-1]) + 1), notes=notes, repeated=repeated)
    if before is None or (before[0].q_encoder is not None and not measured):
        raise InputError("; ".join([f"{sources.paths[0]}: no usable row", *map(_in_words, said.values())]))


def _windows(
    parts: Iterator[list[Stream]], wanted: Mapping[str, Collection[str]]
) -> Iterator[tuple[int, int | None, int, list[Stream]]]:
    """Yield a piece's first and last row (None of the last piece), the row that its streams begin with, and these."""
    held: dict[str, list[Stream]] = {name: [] for name in wanted}
    base, width = next(iter(wanted)), max(1, sum(map(len, wanted.values())))
    size, first, begin, count = max(2 * OVERLAP, MOST_NUMBERS // width), 0, 0, 0
    for part in chain.from_iterable(parts):
        held[part.name].append(part)
        count += part.rows if part.name == base else 0
        while count >= first + size + OVERLAP:
            held = {name: [joined(several)] for name, several in held.items() if several}
            yield first, first + size, begin, _between(held, wanted, 0, first + size + OVERLAP - begin)
            first, kept = first + size, first + size - OVERLAP
            left = _between(held, wanted, kept - begin, None)
            held, begin = {stream.name: [stream] for stream in left}, kept
    if count:
        held = {name: [joined(several)] for name, several in held.items() if several}
        yield first, None, begin, _between(held, wanted, 0, None)


def _between(
    held: Mapping[str, list[Stream]], wanted: Mapping[str, Collection[str]], first: int, last: int | None
) -> list[Stream]:
    """Return rows of q_nominal's stream, and what of others arrived meanwhile, or a row without a number."""
    name, *others = wanted
    (base,) = held[name]
    base = base.part(first, base.rows if last is None else last)
    found = [base]
    for other in others:
        stamp, arrival = (None if each is None else each[:1] for each in (base.stamp, base.arrival))
        none = {column: np.full(1, np.nan) for column in wanted[other]}
        (stream,) = held.get(other, [Stream(other, base.type, none, 1, stamp, arrival)])
        if stream.arrival is not None and base.arrival is not None:
            late = np.inf if last is None else base.arrival[-1]
            early = base.arrival[0] if first else -np.inf
            rows = np.flatnonzero((stream.arrival >= early) & (stream.arrival <= late))
            if len(rows):
                stream = stream.part(int(rows[0]), int(rows[-1]) + 1)
            else:
                stream = replace(stream, columns=none, rows=1, stamp=stamp, arrival=arrival)
        found.append(stream)
    return found


def _going_on(log: MotionLog, rows: Integers, before: MotionLog, its: Integers) -> MotionLog:
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
