"""Import third-party recordings into a MotionLog by a mapping, a known layout or the proposed mapping.

Long bags and text tables are read piece by piece, each with some rows before and after it that are cut off after
synchronisation, so that only one piece is in memory; units and time are inferred once, from a sample.
"""

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.errors import InputError
from catenary.parallel import Progress, silent
from catenary.plant import MotionLog
from catenary.recording.import_formats.columns import Stream, joined, not_used
from catenary.recording.import_formats.importer import NoRowError, columns_wanted, synchronise
from catenary.recording.import_formats.known_layouts import MOTION_LOG, TORQUE_LOG, layout_of_files, read_layout
from catenary.recording.import_formats.mapping import RecordingMapping, mapping_of
from catenary.recording.import_formats.proposal import Proposal, propose
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.table_time import time_of
from catenary.recording.logs import read_log, write_pieces
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.corrections import Mend, si_units, units_of
from catenary.verdict.finding import Finding
from catenary.verdict.whole_turns import turned_back

_MAX_JUDGED_POSITIONS = 4_000_000  # joint positions; checking them takes 0.6 GB
PathLike = str | Path
MappingLike = RecordingMapping | Mapping[str, Any] | Sequence[str] | PathLike


def import_recording(
    sources: PathLike | Sequence[PathLike],
    mapping: MappingLike | None = None,
    *,
    units: str | None = None,
    robot: str | None = None,
    accept_proposal: bool = False,
    answers: Mapping[str, str] | None = None,
    clock: Sequence[str] = (),
) -> MotionLog:
    """Read a recording, also a third-party one: bags of ROS 1 and 2, MCAP, CSV, Parquet, NumPy and MATLAB files.

    Rows are the samples of q_nominal; other streams are resampled to its clock. The log's notes state samples that were
    lost, repeated or out of order. Files of a known layout need no mapping.

    Args:
        sources: A file, or the files of one recording, such as a bag per topic.
        mapping: Columns of each quantity: options such as ["q_nominal=/arm/state.position", "q_encoder=a,b,c@deg"], a
            TOML file, its content, or a `RecordingMapping`.
        units: Units of the joints for positions and velocities without units in the mapping, such as "deg,deg,mm".
        robot: Catalogue name or file: names, units and limits of the joints.
        accept_proposal: Without a mapping, use the proposed one unless it has open questions.
        answers: Answers to open questions of the proposal, such as {"q_encoder": "cam"}; they also accept it.
        clock: Offset [s] and rate [ppm] by which clocks of other files are ahead of q_nominal's at its first row, such
            as "0.73,50", or "cam.csv=0.73,50" for one file; estimated from common motion when empty.

    Raises:
        FileFormatError: A file cannot be read.
        ConfigError: The mapping is invalid.
        InputError: No mapping was given and the layout is unknown (the message holds the proposal), a column is
            missing, units contradict the joints', or no row is left.

    Examples:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> path, t = Path(mkdtemp()) / "run.csv", np.linspace(0.0, 30.0, 900)
        >>> columns = np.column_stack([t, np.sin(t), np.cos(t), 1.02 * np.sin(t), 1.02 * np.cos(t)])
        >>> np.savetxt(path, columns, delimiter=",", comments="", header="time,cmd_1,cmd_2,encoder_1,encoder_2")
        >>> mapping = ["time=time", "q_nominal=cmd_1,cmd_2", "q_encoder=encoder_1,encoder_2"]
        >>> catenary.import_recording(path, mapping, units="rad,rad").q_nominal.shape
        (900, 2)
    """
    how: dict[str, Any] = {"units": units, "robot": robot, "answers": answers, "clock": clock}
    opened = _opened(_paths(sources), mapping, accept_proposal=accept_proposal, **how)
    return opened if isinstance(opened, MotionLog) else synchronise(*opened).log


@dataclass(frozen=True)
class ImportedLog:
    """Result of an import into a file."""

    log: MotionLog  # the checked rows: all, or the first of a long recording
    rows: int
    seconds: float | None  # from the first row to the last; None without time
    measured: int | None  # rows with a valid q_encoder; None without q_encoder
    notes: tuple[str, ...]
    not_used: tuple[str, ...]  # unused topics, arrays and columns of the recording
    findings: tuple[Finding, ...]  # findings of a fit, refusing ones first


def import_to_file(
    out: Path, sources: Sequence[Path], mapping: MappingLike | None = None, *, robot: str | None = None, **how: Any
) -> ImportedLog:
    """Import a recording into a motion log file, a long one piece by piece, within the memory of one piece.

    Args:
        out: Motion log to write (.parquet).
        mapping: Columns of each quantity, as of `import_recording`.
        **how: Further arguments of `import_recording`; `progress` is called with the share of the file read.
    """
    opened = _opened(sources, mapping, robot=robot, **how)
    unused: tuple[str, ...] = ()
    if isinstance(opened, MotionLog):
        logs = iter([opened])
    else:
        logs = pieces_of(*opened)
        unused = not_used(opened[0].streams, columns_wanted(*opened))
    del opened
    first = next(logs)
    # a copy holds no more of it
    judged = deepcopy(first.part(0, min(len(first), _MAX_JUDGED_POSITIONS // len(first.joint_names))))
    rows, measured, last_time, notes = 0, 0, judged.time, judged.notes

    def counted() -> Iterator[MotionLog]:
        nonlocal first, rows, measured, last_time, notes
        for log in chain([first], logs):
            first = judged
            rows, measured, last_time, notes = rows + len(log), measured + int(log.ok.sum()), log.time, log.notes
            yield log

    write_pieces(counted(), out)
    seconds = None if judged.time is None or last_time is None else float(last_time.max() - judged.time.min())
    has_encoder = judged.q_encoder is not None
    if len(judged) < rows <= _MAX_JUDGED_POSITIONS // len(judged.joint_names) and has_encoder:
        judged = read_log(out)
    findings = findings_of(judged, robot=robot_of([judged], robot)) if has_encoder else ()
    if len(judged) < rows and has_encoder:
        notes = (*notes, f"of {rows} rows the first {len(judged)} were judged; catenary check judges all")
    return ImportedLog(judged, rows, seconds, measured if has_encoder else None, notes, unused, findings)


def propose_mapping(
    sources: PathLike | Sequence[PathLike],
    *,
    units: str | None = None,
    robot: str | None = None,
    answers: Mapping[str, str] | None = None,
) -> Proposal:
    """Propose a mapping of columns to quantities, by type, name, rate and range.

    Args:
        sources: A file, or the files of one recording, as of `import_recording`.
        units: Units of the joints, such as "deg,deg,mm".
        robot: Catalogue name or file: names, units and limits of the joints.
        answers: Answers to open questions of the proposal; answers to other questions are refused.

    Returns:
        The proposal; `toml` is its text, to edit and to import with.

    Examples:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> path, t = Path(mkdtemp()) / "run.csv", np.linspace(0.0, 30.0, 900)
        >>> head = "time,cmd_1,encoder_1"
        >>> np.savetxt(path, np.c_[t, np.sin(t), 1.02 * np.sin(t)], delimiter=",", header=head, comments="")
        >>> 'columns = ["encoder_1"]' in catenary.propose_mapping(path).toml
        True
    """
    return propose(Sources(_paths(sources)), robot=robot, units=units, answers=answers)


def known_layout(paths: Sequence[Path], *, robot: str | None = None) -> str | None:
    """Return the name of a layout that needs no mapping, or None.

    Args:
        robot: Catalogue name or file.
    """
    layout = layout_of_files(paths)
    return None if layout == TORQUE_LOG and robot is None else layout


def _opened(
    paths: Sequence[Path],
    mapping: MappingLike | None,
    *,
    units: str | None = None,
    robot: str | None = None,
    accept_proposal: bool = False,
    answers: Mapping[str, str] | None = None,
    clock: Sequence[str] = (),
    progress: Progress = silent,
) -> tuple[Sources, RecordingMapping] | MotionLog:
    """Return a recording, opened, and its mapping; the log of one whose layout needs none."""
    chosen = _as_mapping(mapping, units, robot, clock)
    if chosen is not None:
        if answers:
            raise InputError("answers are to a proposal; here is a mapping, which leaves nothing open")
        return Sources(paths, progress), chosen
    kind = None if answers else known_layout(paths, robot=robot)
    if kind is not None and clock:
        raise InputError(f"--clock: {kind} has a single clock; to correct it, use --clock of fit, evaluate or check")
    if kind is not None:
        model, words = None if robot is None else load_robot(robot), () if units is None else units_of(units)[1]
        si = si_units(words) if len(words) > 1 else None
        log = read_log(paths[0], units=si) if kind == MOTION_LOG else read_layout(paths, kind, model=model, units=si)
        every = words * len(log.joint_names) if len(words) == 1 else words
        log = Mend(units=(",".join(every),))(log) if words else log
        return log if model is None or not words else turned_back(log, model)
    opened = Sources(paths, progress)
    proposal = propose(opened, robot=robot, units=units, answers=answers)
    if not accept_proposal and not answers:
        raise InputError(f"{', '.join(map(str, paths))}: give a mapping, or accept the proposed one:\n{proposal.toml}")
    accepted = proposal.accepted()
    return opened, accepted.model_copy(update={"clock": tuple(clock)}) if clock else accepted


def _paths(sources: PathLike | Sequence[PathLike]) -> list[Path]:
    return [Path(sources)] if isinstance(sources, str | Path) else [Path(source) for source in sources]


def _as_mapping(
    mapping: MappingLike | None, units: str | None, robot: str | None, clock: Sequence[str]
) -> RecordingMapping | None:
    overrides: dict[str, Any] = {"units": units, "settings": {"robot": robot, "clock": list(clock) or None}}
    if mapping is None:
        return None
    if isinstance(mapping, RecordingMapping):
        mapping = mapping.model_dump(mode="json", exclude_unset=True)
    if isinstance(mapping, Mapping):
        return mapping_of((), content=mapping, **overrides)
    options = [str(mapping)] if isinstance(mapping, str | Path) else list(mapping)
    is_file = isinstance(mapping, str | Path) and "=" not in options[0]
    return mapping_of((), file=Path(options[0]), **overrides) if is_file else mapping_of(options, **overrides)


_PIECE_NUMBERS = 1_500_000  # of a piece
_COUNTS = re.compile(r"\d+ of \d+ |\(s\)|\d repeated|\d messages|\d rows")  # in a note on the rows of a piece
_OVERLAP_ROWS = 10_000  # rows before and after a piece: a hundred samples of an encoder at a hundredth of the rate


def pieces_of(sources: Sources, mapping: RecordingMapping, model: RobotModel | None = None) -> Iterator[MotionLog]:
    """Yield a recording's log piece by piece, each with all notes so far; short or other recordings as one piece."""
    pose = None if mapping.q_encoder is None else mapping.q_encoder.pose
    registers = pose is not None and None in (pose.T_base_tracker, pose.T_marker_frame)
    if registers or not sources.is_in_parts:  # pieces would get different registrations
        yield synchronise(sources, mapping, model=model).log
        return
    columns = columns_wanted(sources, mapping)
    texts: dict[str, dict[str, None]] = {}  # notes by their text without numbers
    prefix = ""
    sample = sources.streams[0]
    if sample.type == "table":
        time = time_of(sample, mapping.time, mapping.time_unit, mapping.rate_hz, today=sources.today)
        if time is not None and time.column:
            mapping = mapping.model_copy(update={"time": (time.column,), "time_unit": time.unit})
        if time is not None:
            prefix = f"{sample.name}: time is "
            texts[prefix] = {f"{sample.name}: {time.said}": None}
    before: tuple[MotionLog, Integers] | None = None
    measured = repeated = 0
    for first, last, begin, streams in _windows(sources.parts(columns), columns):
        piece = sources.holding(streams)
        if first == begin == 0 and last is None:
            piece.notes += sources.problems
            yield synchronise(piece, mapping, model=model).log
            return
        where = f"rows {begin + 1} to {begin + streams[0].rows}: "
        try:
            synchronised = synchronise(piece, mapping, model=model, is_piece=True)
        except NoRowError as error:
            texts.setdefault(_shape(str(error)), {})[where + str(error)] = None
            continue
        log, rows = synchronised.log, synchronised.rows + begin
        log = log if before is None else _going_on(log, rows, *before)
        before = (log, rows)
        inside = np.flatnonzero((rows >= first) & (rows < (np.inf if last is None else last)))
        if not len(inside):
            continue
        for note in [note for note in log.notes if not prefix or not note.startswith(prefix)]:
            texts.setdefault(_shape(note), {})[where + note if _COUNTS.search(note) else note] = None
        measured, repeated = measured + int(log.ok[inside].sum()), repeated + log.repeated
        notes = (*map(_in_words, texts.values()), *sources.problems)
        yield replace(log.part(int(inside[0]), int(inside[-1]) + 1), notes=notes, repeated=repeated)
    if before is None or (before[0].q_encoder is not None and not measured):
        raise InputError("; ".join([f"{sources.paths[0]}: no usable row", *map(_in_words, texts.values())]))


def _windows(
    parts: Iterator[list[Stream]], columns: Mapping[str, Collection[str]]
) -> Iterator[tuple[int, int | None, int, list[Stream]]]:
    """Yield a piece's first and last row (None of the last piece), the row that its streams begin with, and these."""
    held: dict[str, list[Stream]] = {name: [] for name in columns}
    base, width = next(iter(columns)), max(1, sum(map(len, columns.values())))
    size, first, begin, count = max(2 * _OVERLAP_ROWS, _PIECE_NUMBERS // width), 0, 0, 0
    for part in chain.from_iterable(parts):
        held[part.name].append(part)
        count += part.rows if part.name == base else 0
        while count >= first + size + _OVERLAP_ROWS:
            held = {name: [joined(several)] for name, several in held.items() if several}
            yield first, first + size, begin, _between(held, columns, 0, first + size + _OVERLAP_ROWS - begin)
            first, kept = first + size, first + size - _OVERLAP_ROWS
            remaining = _between(held, columns, kept - begin, None)
            held, begin = {stream.name: [stream] for stream in remaining}, kept
    if count:
        held = {name: [joined(several)] for name, several in held.items() if several}
        yield first, None, begin, _between(held, columns, 0, None)


def _between(
    held: Mapping[str, list[Stream]], columns: Mapping[str, Collection[str]], first: int, last: int | None
) -> list[Stream]:
    """Return rows of q_nominal's stream, and what of others arrived meanwhile, or a row without a number."""
    name, *others = columns
    (base,) = held[name]
    base = base.part(first, base.rows if last is None else last)
    cut = [base]
    for other in others:
        stamp, arrival = (None if times is None else times[:1] for times in (base.stamp, base.arrival))
        none = {column: np.full(1, np.nan) for column in columns[other]}
        (stream,) = held.get(other, [Stream(other, base.type, none, 1, stamp, arrival)])
        if stream.arrival is not None and base.arrival is not None:
            late = np.inf if last is None else base.arrival[-1]
            early = base.arrival[0] if first else -np.inf
            rows = np.flatnonzero((stream.arrival >= early) & (stream.arrival <= late))
            if len(rows):
                stream = stream.part(int(rows[0]), int(rows[-1]) + 1)
            else:
                stream = replace(stream, columns=none, rows=1, stamp=stamp, arrival=arrival)
        cut.append(stream)
    return cut


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
    more = f"; likewise in {len(alike) - 1} more pieces, which overlap by {2 * _OVERLAP_ROWS} rows"
    return next(iter(alike)) + more * (len(alike) > 1)


def _shape(note: str) -> str:
    """Return a note without its numbers: what pieces say alike."""
    return re.sub(r"\d[\d.,e+-]*", "#", note)
