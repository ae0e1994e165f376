"""The door for recordings: motion logs as Parquet, known layouts as they are, any other by its mapping."""

import json
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catenary.bounded_parsers import cut, no_file, reading, shortened
from catenary.config import Recorded, parse_json
from catenary.errors import FileFormatError, InputError, to_import
from catenary.file_formats import format_of
from catenary.files import damage, sha256_of, written_whole
from catenary.operating_system import lasting_folder
from catenary.plant import JOINT_ARRAYS, Joints, MotionLog
from catenary.robots.model import RobotModel
from catenary.units import TORQUE_UNIT
from catenary.verdict.corrections import NO_MEND, Mend
from catenary.verdict.whole_turns import turned_back

if TYPE_CHECKING:  # the importer brings rosbags and pyarrow, which a motion log alone does without
    from catenary.recording.import_formats.mapping import RecordingMapping

_FORMAT = "catenary.motion_log.1"
_PIECE_ROWS = 65_536  # read at once


class _Stated(Recorded):
    """What a log's schema says of it, beside the units of its columns."""

    format: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    units_assumed: bool = False
    repeated: int = 0
    robot: str | None = None
    simulated: bool = False
    notes: tuple[str, ...] = ()
    began: float = 0.0
    settled: Mapping[str, tuple[str, ...]] = {}
    arrivals: Mapping[str, tuple[float, float]] = {}


@dataclass(frozen=True)
class Reading:
    """What files of recordings do not say of themselves."""

    units: tuple[str, ...] | None = None  # "rad" or "m" per joint
    joint_names: tuple[str, ...] | None = None
    mapping: "RecordingMapping | None" = None  # of a third-party recording, with its own units
    mend: Mend = NO_MEND  # what to change of them
    currents: bool = False  # torques are motor currents, or what the robot reports raw
    as_trained: bool = True  # mend them also as the training data of a model that they are given to


def read_log(
    path: str | Path, *, units: Sequence[str] | None = None, joint_names: Sequence[str] | None = None
) -> MotionLog:
    """Read a recording: a `.parquet` log, a `.npz` command log, or RAVEN-II's published `.csv` (its gold arm).

    Args:
        units: "rad" or "m" per joint, for a file that does not state them.
        joint_names: Names of the joints, for a file that does not state them; one that does is put into their order.

    Raises:
        FileFormatError: No such file, unknown kind, damaged, or something is missing.
        InputError: The numbers are not a log (shape, NaN, unit, empty), or names or units contradict the file's.

    Examples:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> log = catenary.MotionLog("run", ("J1",), ("rad",), q_nominal=np.zeros((3, 1)), ok=np.ones(3, bool))
        >>> path = Path(mkdtemp()) / "run.parquet"
        >>> catenary.write_parquet(log, path)
        >>> catenary.read_log(path).joint_names
        ('J1',)
    """
    path = Path(path)
    if not path.is_file():
        raise FileFormatError(no_file(path))
    ending = format_of(path).ending
    if ending == ".parquet":
        log = read_parquet(path)
    elif ending in (".npz", ".csv"):
        from catenary.recording.import_formats.known_layouts import read_commands, read_raven

        is_raven = ending == ".csv"
        log = read_raven([path]).log if is_raven else read_commands(path, units=units, joint_names=joint_names)
        log = replace(log, settled={"units": ()}) if is_raven else log
    else:
        raise FileFormatError(
            f'{path}: ending "{path.suffix}": expected a recording, .npz, .parquet or .csv; {to_import(path)}'
        )
    names = log.joint_names if joint_names is None else tuple(joint_names)
    if units is not None and len(units) != len(names):
        raise InputError(f"{path}: has {len(names)} joints, {', '.join(names)}, but {len(units)} units were given")
    own = dict(zip(log.joint_names, log.joint_units, strict=True))
    joint_units = tuple(units) if units is not None else tuple(own.get(name, "") for name in names)
    return log.in_order_of(Joints(names, joint_units), of="those given are")


def read_recording(path: str | Path, reading: Reading | None = None) -> MotionLog:
    """Read a recording, by a mapping or as `read_log` does, and correct it.

    Args:
        path, reading: The recording, and its mapping and corrections.

    Raises:
        FileFormatError: No such file, unknown kind, or damaged.
        InputError: The numbers are no recording.
    """
    reading = reading if reading is not None else Reading()
    if reading.mapping is None:
        return reading.mend(read_log(path, units=reading.units, joint_names=reading.joint_names))
    return reading.mend(_by_mapping(Path(path), reading.mapping, None))


def read_torque_log(
    path: Path,
    model: RobotModel,
    reading: Reading | None = None,
    trained: Mapping[str, Sequence[str]] | None = None,
    *,
    joints: Sequence[str] = (),
) -> MotionLog:
    """Read a robot's recording for identification: by a mapping, a `.parquet` motion log, or a `.npz`; and correct it.

    Arrays of the `.npz`: `q` (N, n) in rad and m, `tau` (N, n) in Nm and N, `dq` (N, n) if recorded, and `fs` [Hz] or
    `t` (N,) [s] if the robot moves. `gravity` (N, 3) [m/s2], `base_rate` [rad/s] and `base_acceleration` [rad/s2], in
    base axes, where the base tilts or turns, `base_force` [N] and `base_moment` [Nm] that hold it. `effort` or
    `current` (N, n) in place of `tau` is what the robot reports raw; the robot's file then gives the torque per unit of
    it.

    Args:
        path: The recording.
        model: The robot, in whose order joints are put.
        reading: Mapping and corrections.
        trained: Corrections of the recordings that the robot was identified from.
        joints: Joints that are wanted; others may be missing, and all stay in the file's order. All when empty.

    Raises:
        FileFormatError: No such file, unknown kind, or damaged.
        InputError: No torques, or other joints than the robot's.
    """
    reading = reading if reading is not None else Reading()
    mapping, ending = reading.mapping, format_of(path).ending
    if mapping is not None:
        if not mapping.joint_names and len(mapping.q_nominal.columns) == len(joints):
            mapping = mapping.model_copy(update={"joint_names": tuple(joints)})
        log = _by_mapping(path, mapping, model)
    elif ending == ".parquet":
        log = read_log(path) if joints else read_log(path).of_robot(model, model.name)
    elif ending == ".npz":
        from catenary.recording.import_formats.known_layouts import read_torques

        log = read_torques(path, model, raw=reading.currents, joints=joints)
    else:
        raise FileFormatError(
            f'{path}: ending "{path.suffix}": expected a recording, .npz or .parquet; {to_import(path)}'
        )
    log = reading.mend(log, trained if reading.as_trained else None)
    if reading.mend.units:
        log = turned_back(log, model)
    scale = None if model.actuation is None else model.actuation.effort_scale
    if not reading.currents or scale is None or log.tau is None:
        return log
    from catenary.recording.import_formats.known_layouts import with_effort_scale

    return with_effort_scale(log, model, scale)


def _by_mapping(path: Path, mapping: "RecordingMapping", model: RobotModel | None) -> MotionLog:
    from catenary.recording.import_formats.importer import synchronise
    from catenary.recording.import_formats.recording_files import Sources

    return synchronise(Sources([path]), mapping, model=model).log


def write_parquet(log: MotionLog, path: str | Path) -> None:
    """Write a log as Parquet: a column per number (q_nominal:<joint>, ..., signals), its unit in the metadata.

    Args:
        log, path: The log, and the file (.parquet).

    Examples:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> log = catenary.MotionLog("run", ("J1",), ("rad",), q_nominal=np.zeros((3, 1)), ok=np.ones(3, bool))
        >>> catenary.write_parquet(log, Path(mkdtemp()) / "run.parquet")
    """
    write_pieces([log], path)


def write_pieces(logs: Iterable[MotionLog], path: str | Path) -> None:
    """Write the pieces of a log one after the other; the last one's description is that of the whole.

    Args:
        logs, path: The pieces, and the file (.parquet).
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    with written_whole(Path(path)) as file, ExitStack() as open_writer:
        writer: pq.ParquetWriter | None = None
        for log in logs:
            columns = _columns(log)
            if writer is None:
                fields = [
                    pa.field(name, pa.bool_() if values.dtype == bool else pa.float64(), metadata={"unit": unit})
                    for name, (values, unit) in columns.items()
                ]
                schema = pa.schema(fields, metadata={"catenary": _stated_by(log)})
                # bytes of numbers apart: a tenth smaller and three times as quick as a dictionary of them
                split = {name: "BYTE_STREAM_SPLIT" for name in columns if name != "ok"}
                options = {"compression": "zstd", "write_page_checksum": True, "use_dictionary": False}
                writer = open_writer.enter_context(pq.ParquetWriter(file, schema, column_encoding=split, **options))
            writer.write_table(pa.table([values for values, _ in columns.values()], schema=schema))
            last = _stated_by(log)
        if writer is not None:
            writer.add_key_value_metadata({"catenary": last})


def _stated_by(log: MotionLog) -> str:
    stated = _Stated(format=_FORMAT, **{key: getattr(log, key) for key in _Stated.model_fields if key != "format"})
    return json.dumps(stated.model_dump(mode="json"))


def _columns(log: MotionLog) -> dict[str, tuple[NDArray[Any], str]]:
    """Return the numbers and unit of each column."""
    columns: dict[str, tuple[NDArray[Any], str]] = {} if log.time is None else {"time": (log.time, "s")}
    columns["ok"] = log.ok, ""
    for prefix in JOINT_ARRAYS:
        values = getattr(log, prefix)
        if values is not None:
            for joint, unit, column in zip(log.joint_names, log.joint_units, values.T, strict=True):
                shown = {"tau": TORQUE_UNIT[unit], "qd": f"{unit}/s"}.get(prefix, unit)
                columns[f"{prefix}:{joint}"] = column, shown
    for name, values in log.signals.items():
        if name in columns:
            raise InputError(f'recording "{log.name}": signal "{name}" has the name of a column of every log')
        columns[name] = values, log.signal_units.get(name, "")
    return columns


def read_parquet(path: Path) -> MotionLog:
    """Read a log that `write_parquet` wrote."""
    from pyarrow import default_memory_pool

    from catenary.recording.parquet_files import open_parquet

    try:
        file = open_parquet(path)
        stated = _stated(path, file.metadata.metadata or {})
        columns = _read_columns(path, file)
        units = {field.name: (field.metadata or {}).get(b"unit", b"") for field in file.schema_arrow}
        del file
        default_memory_pool().release_unused()
    except FileFormatError as error:
        if "cannot be read as Parquet" not in str(error):
            raise
        remedy = "a project's log is made again by `catenary extract PROJECT`"
        raise FileFormatError(damage(path, str(error).removeprefix(f"{path}: "), remedy)) from error
    names = stated.joint_names
    if len(set(names)) != len(names):
        raise InputError(f"{path}: joint names must differ, got {', '.join(names)}")
    joints: dict[str, Any] = {}
    for prefix in JOINT_ARRAYS:
        own_columns = [f"{prefix}:{joint}" for joint in names]
        missing = [name for name in own_columns if name not in columns]
        if missing and len(missing) < len(own_columns):
            raise FileFormatError(f"{path}: column(s) {', '.join(missing)} are missing")
        if not missing:
            joints[prefix] = np.column_stack([columns.pop(name) for name in own_columns])
    if "q_nominal" not in joints:
        raise FileFormatError(f"{path}: columns q_nominal:<joint> are missing for {', '.join(names)}")
    if "ok" not in columns:
        raise FileFormatError(f"{path}: column ok, the rows whose q_encoder can be trusted, is missing")
    return MotionLog(
        name=path.stem,
        ok=columns.pop("ok"),
        time=columns.pop("time", None),
        **joints,
        signals=columns,
        signal_units={name: units[name].decode(errors="replace") for name in columns},
        sha256=sha256_of(path),
        settled={"units": (), "time_unit": (), **stated.settled},
        **{key: getattr(stated, key) for key in _Stated.model_fields if key not in ("format", "settled")},
    )


def _read_columns(path: Path, file: Any) -> dict[str, NDArray[Any]]:
    """Return the columns of an open Parquet file, read in pieces: Arrow keeps as much memory as it reads at once."""
    from pyarrow import types

    from catenary.recording.parquet_files import ARROW

    columns: dict[str, NDArray[Any]] = {}
    for field in file.schema_arrow:
        kind, is_ok, shown = field.type, field.name == "ok", f"{path}: column {cut(field.name)}"
        if field.name in columns:
            raise FileFormatError(f"{shown} is there twice, expected once")
        if not (types.is_boolean(kind) if is_ok else types.is_floating(kind) or types.is_integer(kind)):
            expected = "true or false" if is_ok else "numbers"
            raise FileFormatError(f"{shown} holds {cut(str(kind))}, expected {expected}")
        columns[field.name] = np.empty(file.metadata.num_rows, dtype=bool if is_ok else np.float64)
    first = 0
    with reading(path, "Parquet", ARROW):
        for piece in file.iter_batches(_PIECE_ROWS, use_threads=False):
            piece.validate(full=True)
            for field, values in zip(piece.schema, piece.columns, strict=True):
                if values.null_count and not types.is_floating(field.type):  # these become NaN
                    raise FileFormatError(f"{path}: column {cut(field.name)} lacks {values.null_count} of its numbers")
                columns[field.name][first : first + len(piece)] = values.to_numpy(zero_copy_only=False)
            first += len(piece)
    return columns


def _stated(path: Path, metadata: Mapping[bytes, bytes]) -> _Stated:
    """Return the metadata of a log's schema."""
    none = f"{path}: is Parquet but no catenary motion log: its schema lacks the joint names and units"
    if b"catenary" not in metadata:
        raise FileFormatError(f"{none}; {to_import(path)}")
    try:
        stated = parse_json(metadata[b"catenary"], _Stated, "schema")
    except FileFormatError as error:
        raise FileFormatError(f"{none}; {error}") from error
    if stated.format != _FORMAT:
        expected = f"expected {_FORMAT!r}: another version wrote it; make it again"
        raise FileFormatError(f"{path}: log format {shortened(stated.format)}, {expected}")
    return stated


_numbers = count()


@cache
def _folder() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="catenary-", dir=lasting_folder(), ignore_cleanup_errors=True)


def on_disk(log: MotionLog) -> MotionLog:
    """Return a recording with its arrays on disk, bit for bit the same."""

    def kept(array: NDArray[Any]) -> NDArray[Any]:
        path = Path(_folder().name) / f"{next(_numbers)}.npy"
        try:
            np.save(path, array)
            mapped: NDArray[Any] = np.load(path, mmap_mode="r")
        except OSError as error:
            raise InputError(
                f'recording "{log.name}": {path.parent} cannot hold it: {error.strerror}; name another folder by TMPDIR'
            ) from error
        return mapped

    arrays: dict[str, Any] = {
        name: kept(array) for name in (*JOINT_ARRAYS, "time", "ok") if (array := getattr(log, name)) is not None
    }
    return replace(log, **arrays, signals={name: kept(values) for name, values in log.signals.items()})
