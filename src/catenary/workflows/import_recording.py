"""Recordings of any make into a MotionLog: by a mapping, by a known layout, or by the proposal."""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.import_formats.columns import not_used
from catenary.recording.import_formats.importer import columns_wanted, synchronise
from catenary.recording.import_formats.in_pieces import pieces_of
from catenary.recording.import_formats.known_layouts import MOTION_LOG, TORQUE_LOG, layout_of_files, read_layout
from catenary.recording.import_formats.mapping import RecordingMapping, mapping_of
from catenary.recording.import_formats.proposal import Proposal, propose
from catenary.recording.import_formats.sources import Sources
from catenary.recording.logs import read_log, write_pieces
from catenary.robots.catalog import load_robot
from catenary.side_by_side import Progress, silent
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.finding import Finding

MOST_JUDGED = 900_000  # positions of joints
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
) -> MotionLog:
    """Read a recording, third-party ones too: bags of ROS 1 and 2, MCAP, CSV, Parquet, NumPy and MATLAB files.

    Rows are the samples of q_nominal; what has another clock is brought onto it, and what was lost, repeated or out of
    order is in the log's notes. Files of a known layout need no mapping.

    Args:
        sources: A file, or the files of one recording, such as a bag per topic.
        mapping: What is which quantity: options such as ["q_nominal=/arm/state.position", "q_encoder=a,b,c@deg"], a
            TOML file, its content, or a `RecordingMapping`.
        units: Of the joints, for positions and velocities where the mapping has none, such as "deg,deg,mm".
        robot: Catalogue name or file: names, units and limits of the joints.
        accept_proposal: Without a mapping, take the one that is proposed if nothing in it is open.
        answers: To questions that the proposal leaves open, such as {"q_encoder": "cam"}; accepts it, too.

    Raises:
        FileFormatError: A file cannot be read.
        ConfigError: The mapping is none.
        InputError: There is no mapping, and the layout is not a known one: the message holds the proposal. A column
            is not there, units contradict the joints', or no row is left.

    Example:
        log = import_recording("lab.bag", ["q_nominal=/PSM1/measured_js.position[0:3]"], robot="dvrk_psm")
    """
    how: dict[str, Any] = {"units": units, "robot": robot, "accept_proposal": accept_proposal, "answers": answers}
    opened = _opened(_paths(sources), mapping, **how)
    return opened if isinstance(opened, MotionLog) else synchronise(*opened).log


@dataclass(frozen=True)
class ImportedLog:
    """What was imported into a file."""

    log: MotionLog  # its first rows, which were judged
    rows: int
    seconds: float | None  # from the first row to the last; None without time
    measured: int | None  # rows with a trusted q_encoder; None where there is none
    notes: tuple[str, ...]
    not_used: tuple[str, ...]  # topics, arrays and columns of the recording
    findings: tuple[Finding, ...]  # what a fit would say of it; those that refuse first


def import_to_file(
    out: Path, sources: Sequence[Path], mapping: MappingLike | None = None, *, robot: str | None = None, **how: Any
) -> ImportedLog:
    """Write the motion log of a recording; a long text table piece by piece, so that its memory is that of a piece.

    Arguments are those of `import_recording`; `progress` is told the share of a file that was read.
    """
    opened = _opened(sources, mapping, robot=robot, **how)
    left: tuple[str, ...] = ()
    if isinstance(opened, MotionLog):
        logs = iter([opened])
    else:
        logs = pieces_of(*opened)
        left = not_used(opened[0].streams, columns_wanted(*opened))
    del opened
    first = next(logs)
    judged = deepcopy(first.part(0, min(len(first), MOST_JUDGED // len(first.joint_names))))  # holds no more of it
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
    found = findings_of(judged, robot=robot_of([judged], robot)) if has_encoder else ()
    if len(judged) < rows and has_encoder:
        notes = (*notes, f"of {rows} rows the first {len(judged)} were judged; catenary check judges all")
    return ImportedLog(judged, rows, seconds, measured if has_encoder else None, notes, left, found)


def propose_mapping(
    sources: PathLike | Sequence[PathLike],
    *,
    units: str | None = None,
    robot: str | None = None,
    answers: Mapping[str, str] | None = None,
) -> Proposal:
    """Propose what of a recording is which quantity, by type, name, rate and range; `toml` is its text to edit.

    Arguments are those of `import_recording`; answers that are not asked are refused.
    """
    return propose(Sources(_paths(sources)), robot=robot, units=units, answers=answers)


def known_layout(paths: Sequence[Path], *, robot: str | None = None) -> str | None:
    """Return the layout of a file that needs no mapping, in words; None for others."""
    found = layout_of_files(paths)
    return None if found == TORQUE_LOG and robot is None else found


def _opened(
    paths: Sequence[Path],
    mapping: MappingLike | None,
    *,
    units: str | None = None,
    robot: str | None = None,
    accept_proposal: bool = False,
    answers: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> tuple[Sources, RecordingMapping] | MotionLog:
    """Return a recording, opened, and its mapping; the log of one whose layout needs none."""
    chosen = _as_mapping(mapping, units, robot)
    if chosen is not None:
        if answers:
            raise InputError("answers are to a proposal; here is a mapping, which leaves nothing open")
        return Sources(paths, progress), chosen
    found = None if answers else known_layout(paths, robot=robot)
    if found is not None:
        listed = None if units is None else [unit.strip() for unit in units.split(",")]
        if found == MOTION_LOG:
            return read_log(paths[0], units=listed)
        return read_layout(paths, found, model=None if robot is None else load_robot(robot), units=listed)
    opened = Sources(paths, progress)
    proposal = propose(opened, robot=robot, units=units, answers=answers)
    if not accept_proposal and not answers:
        raise InputError(f"{', '.join(map(str, paths))}: give a mapping, or accept the proposed one:\n{proposal.toml}")
    return opened, proposal.accepted()


def _paths(sources: PathLike | Sequence[PathLike]) -> list[Path]:
    return [Path(sources)] if isinstance(sources, str | Path) else [Path(source) for source in sources]


def _as_mapping(mapping: MappingLike | None, units: str | None, robot: str | None) -> RecordingMapping | None:
    given: dict[str, Any] = {"units": units, "settings": {"robot": robot}}
    if mapping is None:
        return None
    if isinstance(mapping, RecordingMapping):
        return mapping_of((), content=mapping.model_dump(mode="json", exclude_unset=True), **given)
    if isinstance(mapping, Mapping):
        return mapping_of((), content=mapping, **given)
    if isinstance(mapping, str | Path):
        is_file = "=" not in str(mapping)
        return mapping_of(() if is_file else [str(mapping)], file=Path(mapping) if is_file else None, **given)
    return mapping_of(list(mapping), **given)
