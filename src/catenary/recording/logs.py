"""Motion logs as files: Parquet with units in the schema, what the importers read, and logs for identification."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import content_in_words, read_arrays
from catenary.arrays import Floats
from catenary.documents import cut, json_table, no_file, shortened
from catenary.errors import FileFormatError, InputError
from catenary.files import damage, sha256_of, table_ending, written_whole
from catenary.plant import JOINT_ARRAYS, Joints, MotionLog, nameless, places_of
from catenary.recording.importers import numbers_of, read_command_log, texts_of
from catenary.robots.model import RobotModel
from catenary.units import TORQUE_UNIT

FORMAT = "catenary.motion_log.1"
# signals of a base that tilts or turns, and arrays (N, 3) of a `.npz`, in base axes
ROWS_OF_BASE = {"gravity": "m/s2", "base_rate": "rad/s", "base_acceleration": "rad/s2"}


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
        log = read_command_log(path, units=units, joint_names=joint_names)
    elif ending == ".csv":
        from catenary.recording.raven_csv import read_raven_csv

        log = replace(read_raven_csv(path).log, sha256=sha256_of(path), settled={"units": ()})
    else:
        raise FileFormatError(
            f'{path}: ending "{path.suffix}": expected a recording, .npz, .parquet or .csv; '
            f"`catenary import {path}` proposes how to read others"
        )
    return _as_given(path, log, units, joint_names)


def write_parquet(log: MotionLog, path: str | Path) -> None:
    """Write a log as Parquet: one column per number, its unit in the column's metadata.

    Columns are `time`, `ok`, `q_nominal:<joint>`, `q_encoder:<joint>`, `qd:<joint>`, `tau:<joint>` and the
    further signals by name.

    Raises:
        InputError: A further signal has the name of another column.
        FileFormatError: The file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns: dict[str, tuple[NDArray[Any], str]] = {} if log.time is None else {"time": (log.time, "s")}
    columns["ok"] = log.ok, ""
    for prefix in JOINT_ARRAYS:
        values = getattr(log, prefix)
        if values is not None:
            for joint, unit, column in zip(log.joint_names, log.joint_units, values.T, strict=True):
                columns[f"{prefix}:{joint}"] = column, _unit(prefix, unit)
    for name, values in log.signals.items():
        if name in columns:
            raise InputError(f'recording "{log.name}": signal "{name}" has the name of a column of every log')
        columns[name] = values, log.signal_units.get(name, "")
    about = {
        "format": FORMAT,
        "joint_names": log.joint_names,
        "joint_units": log.joint_units,
        "units_assumed": log.units_assumed,
        "robot": log.robot,
        "simulated": log.simulated,
        "notes": log.notes,
        "settled": log.settled,
    }
    fields = [
        pa.field(name, pa.bool_() if values.dtype == bool else pa.float64(), metadata={"unit": unit})
        for name, (values, unit) in columns.items()
    ]
    schema = pa.schema(fields, metadata={"catenary": json.dumps(about)})
    table = pa.table([values for values, _ in columns.values()], schema=schema)
    with written_whole(Path(path)) as file:
        pq.write_table(table, file, compression="zstd", write_page_checksum=True)


def read_parquet(path: Path) -> MotionLog:
    """Read a log that `write_parquet` or the extraction wrote.

    Raises:
        FileFormatError: Damaged, not a motion log, or a column is missing or of another type.
        InputError: The numbers are not a log.
    """
    from catenary.recording.parquet_files import open_parquet, read_table

    try:
        file = open_parquet(path)
        about = _about(path, file.schema_arrow.metadata or {})
        table = read_table(path, file)
    except FileFormatError as error:
        if "cannot be read as Parquet" not in str(error):
            raise
        remedy = "a project's log is made again by `catenary extract PROJECT`"
        raise FileFormatError(damage(path, str(error).removeprefix(f"{path}: "), remedy)) from error
    names, joint_units = tuple(about["joint_names"]), tuple(about["joint_units"])
    if len(set(names)) != len(names):
        raise InputError(f"{path}: joint names must differ, got {', '.join(names)}")
    columns: dict[str, NDArray[Any]] = {}
    for field, values in zip(table.schema, table.columns, strict=True):
        is_ok = field.name == "ok"
        if is_ok != (field.type == "bool"):
            expected = "true or false" if is_ok else "numbers"
            raise FileFormatError(f"{path}: column {cut(field.name)} holds {field.type}, expected {expected}")
        columns[field.name] = values.to_numpy(zero_copy_only=False).astype(bool if is_ok else np.float64)
    joints: dict[str, Any] = {}
    for prefix in JOINT_ARRAYS:
        wanted = [f"{prefix}:{joint}" for joint in names]
        missing = [name for name in wanted if name not in columns]
        if missing and len(missing) < len(wanted):
            raise FileFormatError(f"{path}: column(s) {', '.join(missing)} are missing")
        if not missing:
            joints[prefix] = np.column_stack([columns.pop(name) for name in wanted])
    if "q_nominal" not in joints:
        raise FileFormatError(f"{path}: columns q_nominal:<joint> are missing for {', '.join(names)}")
    if "ok" not in columns:
        raise FileFormatError(f"{path}: column ok, the rows whose q_encoder can be trusted, is missing")
    return MotionLog(
        name=path.stem,
        joint_names=names,
        joint_units=joint_units,
        ok=columns.pop("ok"),
        time=columns.pop("time", None),
        **joints,
        signals=columns,
        signal_units={
            name: (table.schema.field(name).metadata or {}).get(b"unit", b"").decode(errors="replace")
            for name in columns
        },
        robot=about.get("robot"),
        simulated=about.get("simulated", False),
        sha256=sha256_of(path),
        units_assumed=about.get("units_assumed", False),
        notes=tuple(about.get("notes", ())),
        settled={"units": (), "time_unit": ()}
        | {key: tuple(texts) for key, texts in about["settled"].items()},
    )


def _about(path: Path, metadata: Mapping[bytes, bytes]) -> dict[str, Any]:
    """Return what a log's schema says of it, checked."""
    none = f"{path}: is Parquet but no catenary motion log: its schema lacks the joint names and units"
    if b"catenary" not in metadata:
        raise FileFormatError(none)
    try:
        about = json_table(metadata[b"catenary"], "schema")
    except FileFormatError as error:
        raise FileFormatError(f"{none}; {error}") from error
    for key, is_needed in (("joint_names", True), ("joint_units", True), ("notes", False)):
        texts = about.get(key, None if is_needed else [])
        if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
            raise FileFormatError(f"{none}; {key}: expected a list of texts, got {shortened(texts)}")
    if about.get("format") != FORMAT:
        raise FileFormatError(f"{path}: log format {shortened(about.get('format'))}, expected {FORMAT!r}")
    for key in ("simulated", "units_assumed"):
        if not isinstance(about.get(key, False), bool):
            raise FileFormatError(
                f"{path}: schema: {key}: expected true or false, got {shortened(about[key])}"
            )
    settled = about.setdefault("settled", {})
    each = list(settled.values()) if isinstance(settled, dict) else [None]
    if not all(isinstance(texts, list) and all(isinstance(text, str) for text in texts) for texts in each):
        raise FileFormatError(f"{none}; settled: expected lists of texts by name, got {shortened(settled)}")
    if not isinstance(about.get("robot"), str | None):
        raise FileFormatError(f"{path}: schema: robot: expected a name, got {shortened(about['robot'])}")
    return about


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
    content = read_arrays(path)

    def numbers(key: str, dimensions: int) -> Floats:
        return numbers_of(path, content, key, dimensions)

    if "q" not in content or not {"tau", "effort"} & set(content):
        raise FileFormatError(
            f"{path}: expected arrays q (N, n) and tau (N, n), and dq, fs or t where the robot moves; "
            f"{content_in_words(content)}"
        )
    q = numbers("q", 2)
    n, own = q.shape[1], Joints(texts_of(path, content, "joint_names"), texts_of(path, content, "units"))
    if not own.joint_names:  # another number of joints is refused below
        own = Joints(model.joint_names if n == model.n else nameless(n), own.joint_units)
    if not own.joint_units and n == model.n:
        which = places_of(Joints(own.joint_names), model, whose=f'robot "{model.name}"', of=f"{path} is of")
        own = own._replace(joint_units=tuple(model.joint_units[j] for j in which))
    time = None
    if "t" in content:
        time = numbers("t", 1)
    elif "fs" in content:
        rate = float(numbers("fs", 0))
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"{path}: fs is {rate}: expected a rate above zero [Hz]")
        time = np.arange(len(q)) / rate
    signals = {
        f"{key}:{axis}": column
        for key in ROWS_OF_BASE
        if key in content
        for axis, column in zip("xyz", _three_columns(path, key, numbers(key, 2)), strict=True)
    }
    log = MotionLog(
        name=path.stem,
        joint_names=own.joint_names,
        joint_units=own.joint_units or ("rad",) * n,
        q_nominal=q,
        ok=np.ones(len(q), dtype=bool),
        time=time,
        qd=numbers("dq", 2) if "dq" in content else None,
        tau=numbers("tau" if "tau" in content else "effort", 2),
        signals=signals,
        signal_units={name: ROWS_OF_BASE[name.partition(":")[0]] for name in signals},
        robot=model.name,
        sha256=sha256_of(path),
    ).in_order_of(model, of=f'robot "{model.name}" has')
    if "tau" in content:
        return log
    scale = None if model.actuation is None else model.actuation.effort_scale
    if scale is None:
        raise InputError(
            f'{path}: has raw efforts, and robot "{model.name}" gives no effort_scale; expected an array tau [Nm or N]'
        )
    assert log.tau is not None  # for the type checker
    return replace(log, tau=log.tau * scale, notes=(*log.notes, "raw efforts times the robot's effort_scale"))


def _three_columns(path: Path, key: str, values: Floats) -> Floats:
    """Return the columns of an array (N, 3).

    Raises:
        InputError: It has another number of columns.
    """
    if values.shape[1] != 3:
        raise InputError(f"{path}: {key}: expected shape (N, 3), got {values.shape}")
    return values.T


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


def _unit(prefix: str, joint_unit: str) -> str:
    return {"tau": TORQUE_UNIT[joint_unit], "qd": f"{joint_unit}/s"}.get(prefix, joint_unit)
