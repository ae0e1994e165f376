"""Layouts that others publish and catenary's own files, which need no mapping."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from catenary.archives import read_arrays
from catenary.errors import FileFormatError
from catenary.files import table_ending
from catenary.plant import MotionLog
from catenary.recording.extract import extract
from catenary.recording.import_formats.importer import import_sources
from catenary.recording.import_formats.mapping import Quantity, RecordingMapping, Signal
from catenary.recording.import_formats.sources import Sources, is_bag
from catenary.recording.logs import read_log, read_torque_log
from catenary.recording.parquet_files import open_parquet
from catenary.recording.raven_csv import WIDTH, WIDTH_WITH_FORCE
from catenary.recording.source import open_recordings
from catenary.recording.synchronise import ROBOT, SynchroniseOptions, synchronise
from catenary.recording.topics import EXT_JPOS, RAVENSTATE, RAVENSTATE_100HZ, Arm
from catenary.robots.model import RobotModel

_STATE_ARRAYS = {"t", "jpos", "jpos_d", "pos", "pos_d"}
# the robot multiplies every joint by 180/pi, metres of the insertion too [raven2 source]
_RAVEN_STATE = RecordingMapping(
    q_nominal=Quantity(columns=("jpos[0:3]",), units=("rad", "rad", "m"), scale=(math.pi / 180.0,)),
    signals={
        **{
            f"q_desired:J{i + 1}": Signal(columns=(f"jpos_d[{i}]",), units=unit, scale=math.pi / 180.0)
            for i, unit in enumerate(("rad", "rad", "m"))
        },
        **{
            f"pos:{axis}": Signal(columns=(f"pos[{i}]",), units="m", scale=1e-6)
            for i, axis in enumerate("xyz")
        },
    },
    time=("t",),
    time_unit="s",
)


@dataclass(frozen=True)
class Layout:
    """A layout that was recognised."""

    name: str
    needs_robot: bool = False  # whose joints' names and units the file lacks


MOTION_LOG = Layout("catenary's motion log")
RAVEN_CSV = Layout("RAVEN-II's published CSV")
COMMAND_LOG = Layout("commanded and measured joints (q_des, q_act, ok)")
TORQUE_LOG = Layout("positions and torques (q, tau, and dq, fs or t)", needs_robot=True)
RAVEN_BAG = Layout("RAVEN-II's topics: raven_state and the external encoders")
RAVEN_STATE = Layout("RAVEN-II's recorded state (jpos, jpos_d, pos, pos_d)")


def layout_of_files(paths: Sequence[Path]) -> Layout | None:
    """Return which known layout the files of a recording have; None for another, which needs a mapping."""
    if not paths or not all(is_bag(path) and path.exists() for path in paths):
        return layout_of_file(paths[0]) if len(paths) == 1 else None
    try:
        topics = {topic.name for source in open_recordings(paths, salvage=True) for topic in source.topics}
    except FileFormatError:  # of other types under these names, say
        return None
    state = topics & {RAVENSTATE.name, RAVENSTATE_100HZ.name}
    return RAVEN_BAG if len(state) == 1 and EXT_JPOS.name in topics else None


def layout_of_file(path: Path) -> Layout | None:
    """Return which known layout a file has; None for another, which needs a mapping."""
    if not path.is_file():
        return None
    ending = table_ending(path)
    if ending == ".parquet":
        return MOTION_LOG if b"catenary" in (open_parquet(path).schema_arrow.metadata or {}) else None
    if ending == ".csv":
        with path.open("rb") as file:
            width = file.readline(100_000).count(b",") + 1
        return RAVEN_CSV if width in (WIDTH, WIDTH_WITH_FORCE) else None
    if ending != ".npz":
        return None
    names = set(read_arrays(path))
    if {"q_des", "q_act", "ok"} <= names:
        return COMMAND_LOG
    if "q" in names and names & {"tau", "effort"}:
        return TORQUE_LOG
    return RAVEN_STATE if names >= _STATE_ARRAYS else None


def read_layout(
    paths: Sequence[Path],
    layout: Layout,
    *,
    model: RobotModel | None = None,
    units: Sequence[str] | None = None,
    joint_names: Sequence[str] | None = None,
) -> MotionLog:
    """Read a recording of a known layout.

    Args:
        paths: The file; bags may be several.
        layout: Which one it has.
        model: The robot, where the layout needs one.
        units: "rad" or "m" per joint, for a file that does not state them.
        joint_names: For a file that does not state them.
    """
    path = paths[0]
    if layout is RAVEN_BAG:
        arm: Arm = "green" if model is not None and model.name == ROBOT["green"] else "gold"
        with TemporaryDirectory() as folder:
            extraction = extract(paths, Path(folder) / path.stem, salvage=True)
            log = synchronise(extraction.folder, SynchroniseOptions(arm=arm)).log
        return replace(log, notes=(*log.notes, *extraction.problems))
    if layout is TORQUE_LOG:
        if model is None:
            raise FileFormatError(
                f"{path}: has {layout.name}, and states neither names nor units of its joints; give the robot"
            )
        return read_torque_log(path, model)
    if layout is RAVEN_STATE:
        return import_sources(Sources([path]), _RAVEN_STATE)
    if layout is COMMAND_LOG and model is not None:
        return read_log(path, units=units or model.joint_units, joint_names=joint_names or model.joint_names)
    return read_log(path, units=units, joint_names=joint_names)
