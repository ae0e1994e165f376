"""The door for recordings: files of catenary and known layouts as they are, any other by its mapping."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from catenary.plant import MotionLog
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.logs import read_log, read_torque_log
from catenary.recording.mend import NOTHING, Mend
from catenary.robots.model import RobotModel


@dataclass(frozen=True)
class Reading:
    """What files of recordings do not say of themselves."""

    units: tuple[str, ...] | None = None  # "rad" or "m" per joint
    joint_names: tuple[str, ...] | None = None
    mapping: RecordingMapping | None = (
        None  # of a recording of another make, which it then is; with its own units
    )
    mend: Mend = NOTHING  # what to change of them
    as_trained: bool = True  # mend them also as the training data of a model that they are given to


def read_logs(paths: Sequence[str | Path], reading: Reading | None = None) -> list[MotionLog]:
    """Read recordings; see `read_recording`."""
    return [read_recording(path, reading) for path in paths]


def read_recording(path: str | Path, reading: Reading | None = None) -> MotionLog:
    """Read a recording, by a mapping or as `read_log` does, and mend it."""
    reading = reading if reading is not None else Reading()
    if reading.mapping is None:
        return reading.mend(read_log(path, units=reading.units, joint_names=reading.joint_names))
    return reading.mend(_by_mapping(Path(path), reading.mapping, None))


def read_torque_recording(
    path: Path,
    model: RobotModel,
    reading: Reading | None = None,
    trained: Mapping[str, Sequence[str]] | None = None,
) -> MotionLog:
    """Read a recording of a robot for identification, by a mapping or as `read_torque_log` does, and mend it.

    Where it is held against identified parameters, `trained` is how the recordings behind these were mended.
    """
    reading = reading if reading is not None else Reading()
    mapping = reading.mapping
    log = read_torque_log(path, model) if mapping is None else _by_mapping(path, mapping, model)
    return reading.mend(log, trained if reading.as_trained else None)


def _by_mapping(path: Path, mapping: RecordingMapping, model: RobotModel | None) -> MotionLog:
    from catenary.recording.import_formats.importer import import_sources
    from catenary.recording.import_formats.sources import Sources

    return import_sources(Sources([path]), mapping, model=model)
