"""Motion logs as Parquet: a column per number, its unit in the schema, what the recording is of beside it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.documents import cut, json_table, shortened
from catenary.errors import FileFormatError, InputError
from catenary.files import damage, sha256_of, written_whole
from catenary.plant import JOINT_ARRAYS, MotionLog
from catenary.units import TORQUE_UNIT

FORMAT = "catenary.motion_log.1"


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
        "began": log.began,
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
        began=float(about.get("began", 0.0)),
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
    if not isinstance(about.get("began", 0.0), int | float):
        raise FileFormatError(f"{path}: schema: began: expected a number, got {shortened(about['began'])}")
    settled = about.setdefault("settled", {})
    each = list(settled.values()) if isinstance(settled, dict) else [None]
    if not all(isinstance(texts, list) and all(isinstance(text, str) for text in texts) for texts in each):
        raise FileFormatError(f"{none}; settled: expected lists of texts by name, got {shortened(settled)}")
    if not isinstance(about.get("robot"), str | None):
        raise FileFormatError(f"{path}: schema: robot: expected a name, got {shortened(about['robot'])}")
    return about


def _unit(prefix: str, joint_unit: str) -> str:
    return {"tau": TORQUE_UNIT[joint_unit], "qd": f"{joint_unit}/s"}.get(prefix, joint_unit)
