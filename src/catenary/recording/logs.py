"""The door for recordings: motion logs and known layouts as they are, any other by its mapping."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from catenary.documents import no_file
from catenary.errors import FileFormatError, InputError
from catenary.files import table_ending
from catenary.plant import Joints, MotionLog
from catenary.recording.import_formats.importer import import_sources
from catenary.recording.import_formats.known_layouts import read_commands, read_raven, read_torques
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.sources import Sources
from catenary.recording.mend import NOTHING, Mend
from catenary.recording.motion_log_file import read_parquet
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


def read_log(
    path: str | Path, *, units: Sequence[str] | None = None, joint_names: Sequence[str] | None = None
) -> MotionLog:
    """Read a recording: a `.parquet` log, a `.npz` command log, or RAVEN-II's published `.csv` (its gold arm).

    Args:
        path: The file.
        units: "rad" or "m" per joint, for a file that does not state them.
        joint_names: Names of the joints, for a file that does not state them; one that does is put into their order.

    Raises:
        FileFormatError: No such file, unknown kind, damaged, or something is missing.
        InputError: The numbers are not a log (shape, NaN, unit, empty), or names or units contradict the file's.
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(no_file(path))
    ending = table_ending(path)
    if ending == ".parquet":
        log = read_parquet(path)
    elif ending == ".npz":
        log = read_commands(path, units=units, joint_names=joint_names)
    elif ending == ".csv":
        log = replace(read_raven([path]).log, settled={"units": ()})
    else:
        raise FileFormatError(
            f'{path}: ending "{path.suffix}": expected a recording, .npz, .parquet or .csv; '
            f"`catenary import {path}` proposes how to read others"
        )
    return _as_given(path, log, units, joint_names)


def read_torque_log(path: Path, model: RobotModel) -> MotionLog:
    """Read a recording of a robot for identification: a `.parquet` motion log, or a `.npz` of positions and torques.

    Arrays of the `.npz`: `q` (N, n) in rad and m, `tau` (N, n) in Nm and N, `dq` (N, n) if recorded, and `fs` [Hz] or
    `t` (N,) [s] if the robot moves. `gravity` (N, 3) [m/s2], `base_rate` [rad/s] and `base_acceleration` [rad/s2], in
    base axes, where the base tilts or turns. `effort` (N, n) in place of `tau` is what the robot reports raw; the
    robot's file then gives the torque per unit of it. With `joint_names` (n,) the joints are put into the robot's
    order; without, and without `units`, they are taken to be the robot's.

    Raises:
        FileFormatError: No such file, unknown kind, damaged, or an array is missing.
        InputError: Wrong shape, NaN, a rate that is not above zero, or raw efforts of a robot without scale.
    """
    ending = table_ending(path)
    if ending == ".parquet":
        return read_log(path).in_order_of(model, of=f'robot "{model.name}" has')
    if ending != ".npz":
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected a recording, .npz or .parquet')
    return read_torques(path, model)


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
    return import_sources(Sources([path]), mapping, model=model)


def _as_given(
    path: Path, log: MotionLog, units: Sequence[str] | None, joint_names: Sequence[str] | None
) -> MotionLog:
    """Return a log that states its joints in the order of those given; refuse others, or other units."""
    names = log.joint_names if joint_names is None else tuple(joint_names)
    if units is not None and len(units) != len(names):
        raise InputError(
            f"{path}: has {len(names)} joints, {', '.join(names)}, but {len(units)} units were given"
        )
    own = dict(zip(log.joint_names, log.joint_units, strict=True))
    said = tuple(units) if units is not None else tuple(own.get(name, "") for name in names)
    return log.in_order_of(Joints(names, said), of="those given are")
