"""Recordings of any make into a MotionLog: by a mapping, by a known layout, or by the proposal."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from catenary.arguments import explained
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.import_formats.importer import import_sources
from catenary.recording.import_formats.known_layouts import MOTION_LOG, Layout, layout_of_files, read_layout
from catenary.recording.import_formats.mapping import RecordingMapping, mapping_of
from catenary.recording.import_formats.proposal import Proposal, propose
from catenary.recording.import_formats.sources import Sources
from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.finding import Finding

PathLike = str | Path
MappingLike = RecordingMapping | Mapping[str, Any] | Sequence[str] | PathLike


@explained
def import_recording(
    sources: PathLike | Sequence[PathLike],
    mapping: MappingLike | None = None,
    *,
    units: str | None = None,
    robot: str | None = None,
    accept_proposal: bool = False,
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

    Raises:
        FileFormatError: A file cannot be read.
        ConfigError: The mapping is none.
        InputError: There is no mapping, and the layout is not a known one: the message holds the proposal. A column
            is not there, units contradict the joints', or no row is left.

    Example:
        log = import_recording("lab.bag", ["q_nominal=/PSM1/measured_js.position[0:3]"], robot="dvrk_psm")
    """
    paths = [Path(sources)] if isinstance(sources, str | Path) else [Path(source) for source in sources]
    chosen = _as_mapping(mapping, units, robot)
    if chosen is not None:
        return import_sources(Sources(paths), chosen)
    found = _known(paths, robot)
    if found is not None:
        listed = None if units is None else [unit.strip() for unit in units.split(",")]
        if found is MOTION_LOG:
            return read_log(paths[0], units=listed)
        return read_layout(paths, found, model=None if robot is None else load_robot(robot), units=listed)
    opened = Sources(paths)
    proposal = propose(opened, robot=robot, units=units)
    if not accept_proposal:
        raise InputError(f"{', '.join(map(str, paths))}: give a mapping, or accept the proposed one:\n{proposal.toml}")
    return import_sources(opened, proposal.accepted())


@explained
def propose_mapping(
    sources: PathLike | Sequence[PathLike], *, units: str | None = None, robot: str | None = None
) -> Proposal:
    """Propose what of a recording is which quantity, by type, name, rate and range; `toml` is its text to edit.

    Args:
        units: As for `import_recording`.

    Raises:
        FileFormatError: A file cannot be read.
    """
    paths = [sources] if isinstance(sources, str | Path) else sources
    return propose(Sources([Path(path) for path in paths]), robot=robot, units=units)


def known_layout(paths: Sequence[Path], *, robot: str | None = None) -> str | None:
    """Return the layout of a file that needs no mapping, in words; None for others."""
    found = _known(paths, robot)
    return None if found is None else found.name


def findings_about(log: MotionLog, *, robot: str | None = None) -> tuple[Finding, ...]:
    """Return what a fit would say of a recording; those that refuse first."""
    return findings_of(log, robot=robot_of([log], robot)) if log.q_encoder is not None else ()


def _known(paths: Sequence[Path], robot: str | None) -> Layout | None:
    found = layout_of_files(paths)
    return None if found is None or (found.needs_robot and robot is None) else found


def _as_mapping(mapping: MappingLike | None, units: str | None, robot: str | None) -> RecordingMapping | None:
    if mapping is None:
        return None
    content: Any = None
    options, file = [], None
    if isinstance(mapping, RecordingMapping):
        content = mapping.model_dump(mode="json", exclude_unset=True)
    elif isinstance(mapping, Mapping):
        content = mapping
    elif isinstance(mapping, str | Path) and "=" not in str(mapping):
        file = Path(mapping)
    else:
        options = [str(mapping)] if isinstance(mapping, str | Path) else list(mapping)
    return mapping_of(options, file=file, content=content, units=units, settings={"robot": robot})
