"""Tables in files of many kinds as streams of named columns: CSV, Parquet, NumPy, and MATLAB up to version 7.

Of what OptiTrack's Motive exports a body's columns are `NAME.position.x` [m] and `NAME.orientation.w`, as a message's;
what was not seen is NaN.
"""

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from catenary.archives import MAX_ARRAYS, MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO, read_array, read_arrays
from catenary.arrays import Floats
from catenary.bounded_parsers import cut, reading
from catenary.errors import FileFormatError, InputError
from catenary.file_formats import endings, format_named, format_of
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.import_formats.csv_files import NAMELESS_ARRAY, TextTable
from catenary.recording.parquet_files import ARROW, MOST_COLUMNS, open_parquet

_PANDAS_INDEX = "__index_level_0__"  # how pandas calls an index without a name
_MAX_DEPTH = 8  # structs and cells within each other
_HEAD_LINES = 16  # lines in which Motive's names stand, at most
_METRES = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}


def read_rows(path: Path, names: Sequence[str]) -> Floats:
    """Read columns of a table by their names.

    Args:
        path, names: The table, and names of k columns.

    Returns:
        (N, k).

    Raises:
        FileFormatError: A column is missing.
    """
    (stream,) = read_table_file(path)
    missing = [name for name in names if name not in stream.columns]
    if missing:
        raise InputError(
            f"{path}: no column {', '.join(missing)}; expected {', '.join(names)}, got {', '.join(stream.columns)}"
        )
    return np.column_stack([np.asarray(stream.columns[name], dtype=float) for name in names])


def read_table_file(path: Path, episode: str = "") -> list[Stream]:
    """Read a file or dataset as streams without stamps; arrays of another number of rows are streams `FILE#ROWS`."""
    if not path.exists():
        raise FileFormatError(f"{path}: no such file")
    form = format_of(path)
    if form.holds == "nothing read" and form.advice:
        raise FileFormatError(f"{path}: is {form.name}: {form.advice}")
    if form.holds != "columns":
        raise FileFormatError(
            f'{path}: ending "{path.suffix}": expected a bag (.bag, .mcap, the folder of a ROS 2 bag) or a table '
            f"({', '.join(endings('columns'))})"
        )
    read = form.reads(path)
    streams: list[Stream] = read(path, episode) if form.has_episodes else read(path)
    return streams


def read_text(path: Path) -> list[Stream]:
    """Read a table of text whole."""
    text = TextTable(path)
    parts = list(text.streams())
    if not parts:
        raise FileFormatError(f"{path}: has no row of numbers")
    return [replace(joined(parts), notes=tuple(text.notes))]


def read_numpy(path: Path) -> list[Stream]:
    """Read NumPy's archive of arrays, or its array, whose columns are `data[0]`, `data[1]`, ..."""
    is_archive = format_of(path).ending == ".npz"
    return streams_of_arrays(path, read_arrays(path) if is_archive else {NAMELESS_ARRAY: read_array(path)})


def read_gzip_table(path: Path) -> list[Stream]:
    """Read a table that gzip packed, as .csv.gz, within the bounds of any packed file."""
    if format_named(Path(path.stem)).holds != "columns":
        raise FileFormatError(f"{path}: is packed, and no table; `gzip -d {path.name}` unpacks it")
    limit = max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * path.stat().st_size)
    with TemporaryDirectory() as folder:
        plain = Path(folder) / path.stem
        try:
            with gzip.open(path) as packed, plain.open("wb") as file:
                while block := packed.read(2**20):
                    if file.tell() + len(block) > limit:
                        raise ValueError(f"unpacks to more than {limit} bytes")
                    file.write(block)
        except (OSError, EOFError, ValueError, zlib.error) as error:
            raise FileFormatError(f"{path}: cannot be unpacked: {cut(str(error))}") from error
        try:
            return read_table_file(plain)
        except (FileFormatError, InputError) as error:
            raise type(error)(str(error).replace(str(plain), str(path))) from error


def _table(path: Path, columns: Mapping[str, NDArray[Any]], notes: list[str], **known: Any) -> Stream:
    """Return a stream of columns; whole numbers that a float64 cannot hold, and an int64 can, stay whole."""
    if len(columns) > MOST_COLUMNS:
        raise InputError(f"{path}: {len(columns)} columns, expected {MOST_COLUMNS} at most")
    numbers: dict[str, NDArray[Any]] = {}
    for name, values in columns.items():
        whole = values.dtype.kind in "iu" and 2.0**53 < np.abs(values.astype(np.float64)).max(initial=0.0) < 2.0**63
        with np.errstate(over="ignore"):
            numbers[name] = values.astype(np.int64 if whole else np.float64)
    rows = len(next(iter(numbers.values()))) if numbers else 0
    if rows == 0:
        raise FileFormatError(f"{path}: has no row of numbers")
    return Stream(path.stem, "table", numbers, rows, notes=tuple(notes), **known)


def streams_of_arrays(
    path: Path,
    arrays: Mapping[str, NDArray[Any]],
    units: Mapping[str, list[str]] | None = None,
    *,
    rows_first: bool = False,
) -> list[Stream]:
    """Return arrays by their number of rows, that of most numbers first; with `rows_first` none is turned.

    `units` are those that a file states of an array, one, or one for each column.
    """
    for name, a in arrays.items():
        width = 0 if a.ndim != 2 else a.shape[1] if rows_first else min(a.shape)
        if width > MOST_COLUMNS:  # before as many names are made
            raise InputError(f"{path}: {cut(name)}: has {width} columns, expected {MOST_COLUMNS} at most")
    plain = {name: a for name, a in arrays.items() if a.dtype.kind in "biuf" and a.size}
    plain = plain if rows_first else {name: np.squeeze(a) for name, a in plain.items()}
    texts = {name: _texts(path, name, a) for name, a in arrays.items() if a.dtype.kind in "US" and a.ndim <= 1}
    constants = {name: float(a) for name, a in plain.items() if a.ndim == 0}
    plain = {name: a for name, a in plain.items() if a.ndim in (1, 2)}
    if not plain:
        there = ", ".join(f"{cut(name)} {a.shape}" for name, a in list(arrays.items())[:10]) or "nothing"
        raise FileFormatError(f"{path}: holds no array of numbers of one or two dimensions; it has {there}")
    left = [cut(name) for name in arrays if name not in {**plain, **texts, **constants}]
    numbers = Counter[int]()
    for a in plain.values():
        numbers[len(a) if rows_first else max(a.shape)] += a.size
    rows = max(numbers, key=lambda size: (numbers[size], size))
    groups: dict[int, dict[str, NDArray[Any]]] = {rows: {}}
    stated = dict[str, str]()
    notes = [f"arrays that hold no rows of numbers were left out: {', '.join(left[:10])}"] * bool(left)
    for name, a in plain.items():
        if a.ndim == 2 and not rows_first and a.shape[0] != rows and (a.shape[1] == rows or a.shape[0] < a.shape[1]):
            a = a.T
            notes.append(f"{name}: had a row for each column, and was turned")
        columns = {name: a} if a.ndim == 1 else {f"{name}[{i}]": a[:, i] for i in range(a.shape[1])}
        groups.setdefault(len(a), {}).update(columns)
        own = (units or {}).get(name, [])
        stated |= dict(zip(columns, own if len(own) == len(columns) else own[:1] * len(columns), strict=False))
    notes += [
        f"{', '.join(map(cut, columns))}: has {size} rows where others have {rows}, and is a table of its own"
        for size, columns in groups.items()
        if size != rows
    ]
    names = {size: path.stem if size == rows else f"{path.stem}#{size}" for size in groups}
    known: dict[str, Any] = {"constants": constants, "texts": texts, "units": stated}
    made = ((size, _table(path, columns, notes, **known)) for size, columns in groups.items() if columns)
    return [replace(table, name=names[size]) for size, table in made]


def _texts(path: Path, name: str, values: NDArray[Any]) -> tuple[str, ...]:
    try:
        return tuple(v.decode() if isinstance(v, bytes) else str(v) for v in np.atleast_1d(values).tolist())
    except (UnicodeDecodeError, SystemError) as error:  # SystemError: NumPy's, of what is no character
        raise InputError(f"{path}: {name}: expected texts in UTF-8: {error}") from error


def read_parquet_table(path: Path) -> list[Stream]:
    """Read numbers, truth values, stamps and lists of one length as one stream."""

    def is_number(kind: pa.DataType) -> bool:
        return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind))

    def numbers(column: pa.ChunkedArray) -> NDArray[Any]:
        values: NDArray[Any] = column.to_numpy()
        return values.astype(np.float64) if values.dtype.kind == "O" else values  # truth values, and some missing

    file = open_parquet(path)
    columns: dict[str, NDArray[Any]] = {}
    names, left, notes, dates, units = file.schema_arrow.names, list[str](), list[str](), list[str](), dict[str, str]()
    with reading(path, "Parquet", ARROW):
        for name in names:
            kind, widths = file.schema_arrow.field(name).type, [0]
            is_list = pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)
            is_known = is_number(kind.value_type if is_list else kind) or pa.types.is_timestamp(kind)
            if names.count(name) == 1 and is_known:
                column = file.read(columns=[name], use_threads=False).column(0)
                widths = pc.unique(pc.list_value_length(column)).to_pylist() if is_list else [1]
            if len(widths) != 1 or not widths[0] or widths[0] > MOST_COLUMNS:
                left.append(name)
            elif is_list:
                flat = numbers(pc.list_flatten(column)).reshape(-1, widths[0])
                columns |= {f"{name}[{i}]": flat[:, i] for i in range(widths[0])}
            elif is_number(kind):
                columns[name] = numbers(column)
            else:
                plain = "time" if name == _PANDAS_INDEX and "time" not in names else name
                dates.append(plain)
                columns[plain] = column.cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy()
                notes.append(f"{plain}: holds stamps, read as nanoseconds")
            stated = file.schema_arrow.field(name).metadata or {}
            unit = stated.get(b"units", stated.get(b"unit", b"")).decode(errors="replace")
            units |= dict.fromkeys(columns.keys() - units.keys(), unit)
    if left:
        notes.append(f"columns that hold no numbers were left out: {', '.join(map(cut, left[:10]))}")
    return [_table(path, columns, notes, dates=tuple(dates), units=units)]


def read_matlab(path: Path) -> list[Stream]:
    """Read the arrays of numbers of a `.mat`; those within structs are called `struct.field`."""
    from scipy.io import loadmat, whosmat

    with reading(path, "a MATLAB file", (Exception,)):  # scipy raises of any kind over bytes that are no such file
        data = path.read_bytes()
        for _, shape, _ in whosmat(path):  # scipy makes room for as many cells as the file states
            if 8 * prod(shape) > max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * len(data)):
                raise ValueError(f"an array of shape {shape} in {len(data)} bytes")
        content = loadmat(path, simplify_cells=True, verify_compressed_data_integrity=True)
    arrays: dict[str, NDArray[Any]] = {}
    _collect({key: value for key, value in content.items() if not key.startswith("__")}, "", arrays)
    return streams_of_arrays(path, arrays)


def _collect(content: dict[str, Any], prefix: str, arrays: dict[str, NDArray[Any]], depth: int = 0) -> None:
    for key, value in content.items():
        if isinstance(value, dict) and depth < _MAX_DEPTH:
            _collect(value, f"{prefix}{key}.", arrays, depth + 1)
            continue
        if len(arrays) < MAX_ARRAYS:
            arrays[prefix + key] = np.asarray(value)


def read_tracker_file(path: Path) -> list[Stream]:
    """Read Motive's CSV: a line of settings, then lines of types, names, IDs and axes above the columns of poses."""
    from scipy.spatial.transform import Rotation

    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        head = [next(csv.reader([line]), []) for line in islice(file, _HEAD_LINES)]
    stated = dict(zip(head[0][::2], head[0][1::2], strict=False))
    length, turns = stated.get("Length Units", "").lower(), stated.get("Rotation Type", "Quaternion")
    axes_at = next((i for i, row in enumerate(head) if row and row[0] == "Frame"), 0)
    if axes_at < 4 or length not in _METRES:
        raise FileFormatError(
            f"{path}: is Motive's export, format {stated.get('Format Version')}: expected lines of types, names and "
            f"axes, and Length Units of {', '.join(_METRES)}, got {cut(length) or 'none'}"
        )
    kinds, names, *_, parts = [[cell.strip() for cell in row] for row in head[1:axes_at] if len(row) > 2]
    notes = [f"is Motive's export, format {stated.get('Format Version')}, in {length}"]
    is_euler = re.fullmatch("[XYZ]{3}", turns) is not None
    if is_euler:
        notes.append(f"its orientations are angles, read as turns about axes that turn with it, {' then '.join(turns)}")
    if began := stated.get("Capture Start Time"):
        notes.append(f"its time counts from its own begin, {cut(began)} of that computer")
    quantities, left = {"1": ("time", 1.0)}, dict[str, None]()
    for i, (kind, name, part, axis) in enumerate(zip(kinds, names, parts, head[axes_at], strict=False)):
        scale = {"Position": _METRES[length], "Rotation": 1.0}.get(part, 0.0)
        what = "orientation" if part == "Rotation" else "position"
        column = (f"{name}{' (solved)' * (kind == 'Rigid Body Marker')}.{what}.{axis.lower()}", scale)
        if scale and (name.startswith("Unlabeled") or column in quantities.values()):
            left[name] = None
        elif scale:
            quantities[str(i)] = column
    notes += [f"markers without a name of their own were left out: {', '.join(map(cut, list(left)[:5]))}"] * bool(left)
    names = [str(i) for i in range(len(head[axes_at]))]
    of_file = pa.csv.ReadOptions(use_threads=False, column_names=names, skip_rows=axes_at + 1)
    numbers = pa.csv.ConvertOptions(
        column_types=dict.fromkeys(quantities, pa.float64()), include_columns=list(quantities)
    )
    with reading(path, "Motive's export", ARROW):
        table = pa.csv.read_csv(path, of_file, convert_options=numbers)
    if not table.num_rows:
        raise FileFormatError(f"{path}: has no row with a pose")
    columns = {name: scale * table.column(i).to_numpy() for i, (name, scale) in quantities.items()}
    for base in [name.removesuffix(".x") for name in columns if is_euler and name.endswith("orientation.x")]:
        angles = np.column_stack([columns[f"{base}.{axis.lower()}"] for axis in turns])
        seen = np.isfinite(angles).all(axis=1)
        q = np.full((len(angles), 4), np.nan)
        q[seen] = Rotation.from_euler(turns, angles[seen], degrees=True).as_quat()
        columns |= {f"{base}.{axis}": q[:, i] for i, axis in enumerate("xyzw")}
    return [Stream(path.stem, "table", columns, table.num_rows, notes=tuple(notes))]
