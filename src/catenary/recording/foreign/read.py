"""The door for recordings: files of catenary and known layouts as they are, any other by its mapping."""

from collections.abc import Sequence
from pathlib import Path

from catenary.plant import MotionLog
from catenary.recording.foreign.importer import import_sources
from catenary.recording.foreign.mapping import RecordingMapping
from catenary.recording.foreign.sources import Sources
from catenary.recording.logs import read_log, read_torque_log
from catenary.robots.model import RobotModel


def read_recording(
    path: str | Path,
    mapping: RecordingMapping | None = None,
    *,
    units: Sequence[str] | None = None,
    joint_names: Sequence[str] | None = None,
) -> MotionLog:
    """Read a recording: by a mapping, or as `read_log` does.

    Args:
        path: The file, or a bag's folder.
        mapping: What is which quantity, of a recording of another make; it has its own units and names.
        units: "rad" or "m" per joint, for a file that does not state them.
        joint_names: Names of the joints, for a file that does not state them.

    Raises:
        FileFormatError: As `read_log`, or the file cannot be read.
        InputError: As `read_log`, or what the mapping names is not there.
    """
    if mapping is None:
        return read_log(path, units=units, joint_names=joint_names)
    return import_sources(Sources([Path(path)]), mapping)


def read_torque_recording(
    path: Path, model: RobotModel, mapping: RecordingMapping | None = None
) -> MotionLog:
    """Read a recording of a robot for identification: by a mapping, or as `read_torque_log` does.

    Raises:
        FileFormatError: As `read_torque_log`, or the file cannot be read.
        InputError: As `read_torque_log`, or what the mapping names is not there.
    """
    if mapping is None:
        return read_torque_log(path, model)
    return import_sources(Sources([path]), mapping, model=model)
