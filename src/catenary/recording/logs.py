"""Motion logs as files: Parquet with units in the schema, and whatever the importers read."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.errors import FileFormatError, InputError
from catenary.plant import MotionLog
from catenary.recording.hashing import sha256_of
from catenary.recording.importers import read_command_log

FORMAT = "catenary.motion_log.1"
PER_JOINT = {"q_nominal": "{u}", "q_encoder": "{u}", "qd": "{u}/s", "tau": None}  # column prefix -> unit


def read_log(
    path: Path, *, units: Sequence[str] | None = None, joint_names: Sequence[str] | None = None
) -> MotionLog:
    """Read a recording: a `.parquet` log or a `.npz` command log.

    Args:
        path: The file.
        units: "rad" or "m" per joint, where the file does not state them.
        joint_names: Names of the joints, where the file does not state them.

    Raises:
        FileFormatError: No such file, unknown kind, damaged, or something is missing.
        InputError: The numbers are not a log: shape, NaN, unit, empty.
    """
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file")
    if path.suffix == ".parquet":
        return read_parquet(path, units=units)
    if path.suffix == ".npz":
        return read_command_log(path, units=units, joint_names=joint_names)
    raise FileFormatError(f'{path}: ending "{path.suffix}": expected a recording, .npz or .parquet')


def write_parquet(log: MotionLog, path: Path) -> None:
    """Write a log as Parquet: one column per number, its unit in the column's metadata.

    Columns are `time`, `ok`, `q_nominal:<joint>`, `q_encoder:<joint>`, `qd:<joint>`, `tau:<joint>` and the
    further signals by name.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns: list[tuple[str, NDArray[Any], str]] = []
    if log.time is not None:
        columns.append(("time", log.time, "s"))
    columns.append(("ok", log.ok, ""))
    for prefix in PER_JOINT:
        values = getattr(log, prefix)
        if values is not None:
            for i, (joint, unit) in enumerate(zip(log.joint_names, log.joint_units, strict=True)):
                columns.append((f"{prefix}:{joint}", values[:, i], _unit(prefix, unit)))
    for name, values in log.signals.items():
        columns.append((name, values, log.signal_units.get(name, "")))
    about = {
        "format": FORMAT,
        "joint_names": log.joint_names,
        "joint_units": log.joint_units,
        "robot": log.robot,
        "simulated": log.simulated,
    }
    schema = pa.schema(
        [
            pa.field(name, pa.bool_() if values.dtype == bool else pa.float64(), metadata={"unit": unit})
            for name, values, unit in columns
        ],
        metadata={"catenary": json.dumps(about)},
    )
    pq.write_table(pa.table([values for _, values, _ in columns], schema=schema), path, compression="zstd")


def read_parquet(path: Path, *, units: Sequence[str] | None = None) -> MotionLog:
    """Read a log that `write_parquet` or the extraction wrote.

    Raises:
        FileFormatError: Damaged, not a motion log, or a column is missing.
        InputError: The units given contradict the file's, or the numbers are not a log.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, pa.ArrowException, OSError) as error:
        raise FileFormatError(f"{path}: cannot be read as Parquet: {error}") from error
    metadata = table.schema.metadata or {}
    try:
        about = json.loads(metadata[b"catenary"])
        names = tuple(str(name) for name in about["joint_names"])
        joint_units = tuple(str(unit) for unit in about["joint_units"])
        if about["format"] != FORMAT:
            raise FileFormatError(f"{path}: log format {about['format']!r}, expected {FORMAT!r}")
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise FileFormatError(
            f"{path}: is Parquet but no catenary motion log: its schema lacks the joint names and units"
        ) from error
    if units is not None and tuple(units) != joint_units:
        raise InputError(
            f"{path}: states the units {','.join(joint_units)}, but {','.join(units)} were given"
        )
    columns = {name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names}
    joints: dict[str, Any] = {}
    for prefix in PER_JOINT:
        wanted = [f"{prefix}:{joint}" for joint in names]
        present = [name for name in wanted if name in columns]
        if present and len(present) != len(wanted):
            missing = ", ".join(name for name in wanted if name not in columns)
            raise FileFormatError(f"{path}: column(s) {missing} are missing")
        if present:
            joints[prefix] = np.column_stack([columns.pop(name).astype(np.float64) for name in wanted])
    for required in ("q_nominal",):
        if required not in joints:
            raise FileFormatError(f"{path}: columns {required}:<joint> are missing for {', '.join(names)}")
    rows = table.num_rows
    time = columns.pop("time", None)
    ok = columns.pop("ok", np.ones(rows, dtype=bool)).astype(bool)
    return MotionLog(
        name=path.stem,
        joint_names=names,
        joint_units=joint_units,
        ok=ok,
        time=None if time is None else time.astype(np.float64),
        **joints,
        signals={name: values.astype(np.float64) for name, values in columns.items()},
        signal_units={
            name: (table.schema.field(name).metadata or {}).get(b"unit", b"").decode() for name in columns
        },
        robot=about.get("robot"),
        simulated=bool(about.get("simulated", False)),
        sha256=sha256_of(path),
    )


def _unit(prefix: str, joint_unit: str) -> str:
    pattern = PER_JOINT[prefix]
    if pattern is None:
        return "Nm" if joint_unit == "rad" else "N"
    return pattern.format(u=joint_unit)
