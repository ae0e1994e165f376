"""CSV with a line of names, as spreadsheets, MATLAB, rostopic and PlotJuggler write it."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.parquet_files import MOST_COLUMNS

MOST_LINE = 1_000_000  # characters
_LOOKED_AT = 200  # lines by which separator, decimal sign and kinds of columns are told
_NOTHING = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "None", "none", "#N/A")
_EXACT = 2.0**53  # from which on a float64 has not every whole number
_DATE = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d(:\d\d(\.\d{1,9})?)?(?P<zone>Z|[+-]\d\d(:?\d\d)?)?")
_SAYS_SEPARATOR = re.compile(r"\"?sep=[;,\t]\"?[;,\t]*")  # a first line for spreadsheets


class _Dialect(NamedTuple):
    separator: str
    decimal: str


def read_csv(path: Path) -> tuple[dict[str, NDArray[np.generic]], list[str]]:
    """Read the columns of numbers of a CSV, and what there is to say of it; column_1, ... where a line of names lacks.

    Commas, semicolons, tabs and spaces separate columns, decimals have a point or, where commas separate nothing, a
    comma. Dates as of ISO 8601 become nanoseconds since 1970; a first column of them without a name is the time. Other
    columns of text are left out. Of a name that is there twice, the second is called `name#2`. Whole numbers
    that a float64 cannot hold, such as stamps in nanoseconds, stay whole.
    """
    head = _first_lines(path)
    skipped = 1 if head and _SAYS_SEPARATOR.fullmatch(head[0]) else 0
    head = head[skipped:]
    if len(head) < 2:
        raise FileFormatError(f"{path}: expected a line of names and lines of numbers, got {len(head)} line(s)")
    dialect = _dialect(head)
    first = head[0].lstrip("\ufeff").lstrip("#% \t") if head[0][:1] in "#%\ufeff" else head[0]
    names = [name.strip() for name in _split(first, dialect)]
    nameless = all(not name or is_number(_point(name, dialect)) for name in names)
    if nameless:  # no line of names: they are numbered, and a mapping says which is what
        head = ["", *head]
        names = [f"column_{i + 1}" for i in range(len(names))]
    if len(names) > MOST_COLUMNS:
        raise FileFormatError(f"{path}: {len(names)} columns, expected {MOST_COLUMNS} at most")
    rows = [_split(line, dialect) for line in head[1:] if line.strip()]
    while names and not names[-1] and all(len(row) < len(names) or not row[len(names) - 1] for row in rows):
        names.pop()  # a separator at the end of each line
        rows = [row[: len(names)] for row in rows]
        if len(names) < len(_split(first, dialect)) - 1:
            break
    unique, notes = _unique(names)
    if nameless:
        notes.append(f"has no line of names: its columns are called column_1 to column_{len(unique)}")
    ends_in_separator = len(unique) < len(_split(first, dialect))
    kinds = [_kind([row[i] for row in rows if i < len(row)], dialect) for i in range(len(unique))]
    if not names[0] and kinds[0] is not None and pa.types.is_timestamp(kinds[0]) and "time" not in unique:
        unique[0] = "time"
    texts = [name for name, kind in zip(unique, kinds, strict=True) if kind is None]
    if texts:
        notes.append(f"columns of text were left out: {', '.join(map(cut, texts[:10]))}")
    types = {name: kind for name, kind in zip(unique, kinds, strict=True) if kind is not None}
    if not types:
        raise FileFormatError(f"{path}: no column of numbers among {', '.join(map(cut, unique[:10]))}")
    read = pa.csv.ReadOptions(column_names=[*unique, *[" "] * ends_in_separator], skip_rows=skipped + (not nameless))
    parse = pa.csv.ParseOptions(delimiter=dialect.separator)
    convert = pa.csv.ConvertOptions(
        column_types=types, include_columns=list(types), null_values=list(_NOTHING),
        decimal_point=dialect.decimal, true_values=["true", "True", "TRUE"], false_values=["false", "False", "FALSE"],
    )  # fmt: skip
    try:
        table = pa.csv.read_csv(path, read, parse, convert)
    except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
        raise FileFormatError(f"{path}: cannot be read as CSV: {cut(str(error))}") from error
    columns = {}
    for name, kind in types.items():
        column = table.column(name)
        if pa.types.is_timestamp(kind):
            column = column.cast(pa.int64())
            zone = "UTC" if kind.tz else "no time zone, as if of UTC"
            notes.append(f"{name}: holds dates, read as nanoseconds since 1970 ({zone})")
        columns[name] = column.to_numpy()
    if dialect != (",", "."):
        separator = {"\t": "tabs", " ": "spaces"}.get(dialect.separator, f'"{dialect.separator}"')
        notes.append(f'columns are separated by {separator}, decimals by "{dialect.decimal}"')
    return columns, notes


def is_number(text: str) -> bool:
    """Return true for a cell of a text table that is a number; NaN and infinity are."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _first_lines(path: Path) -> list[str]:
    try:
        with path.open("rb") as file:
            lines = [file.readline(MOST_LINE + 1) for _ in range(_LOOKED_AT)]
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
    if any(len(line) > MOST_LINE for line in lines):
        raise FileFormatError(f"{path}: a line of more than {MOST_LINE} bytes; is this a CSV?")
    if lines[0][:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError(f"{path}: is UTF-16, expected UTF-8")
    if any(b"\0" in line for line in lines):
        raise FileFormatError(f"{path}: holds bytes that are no text, expected CSV")
    try:
        return [text for line in lines if (text := line.decode("utf-8-sig").rstrip("\r\n"))]
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: is no UTF-8 text: {error}") from error


def _dialect(lines: Sequence[str]) -> _Dialect:
    """Tell what separates columns: what is in every line equally often; commas only where nothing else does."""
    for separator in (";", "\t"):
        if all(separator in line for line in lines[:20]):
            body = [field.strip() for line in lines[1:] for field in line.split(separator)]
            with_comma = sum("," in field and is_number(field.replace(",", ".")) for field in body)
            return _Dialect(separator, "," if with_comma else ".")
    if "," in lines[0]:
        return _Dialect(",", ".")
    return _Dialect(" " if " " in lines[1].strip() else ",", ".")


def _split(line: str, dialect: _Dialect) -> list[str]:
    if dialect.separator == " ":
        return line.split(" ")
    return next(csv.reader(islice([line], 1), delimiter=dialect.separator), [])


def _point(text: str, dialect: _Dialect) -> str:
    return text.replace(",", ".") if dialect.decimal == "," else text


def _unique(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return names that differ, and a note on those that did not."""
    seen: Counter[str] = Counter()
    unique = []
    taken = set(names)
    for i, name in enumerate(names):
        name = name or f"column{i + 1}"
        seen[name] += 1
        new = name
        while seen[name] > 1 and new in taken:
            new = f"{name}#{seen[name]}"
            seen[name] += new in taken
        taken.add(new)
        unique.append(new)
    twice = [name for name, count in seen.items() if count > 1]
    note = f"names that are there more than once are numbered, such as {cut(twice[0])}#2" if twice else ""
    return unique, [note] if note else []


def _kind(fields: Sequence[str], dialect: _Dialect) -> pa.DataType | None:
    """Return how a column is read: by its first rows; None for text."""
    values = [text for field in fields if (text := field.strip().strip('"')) not in _NOTHING]
    if values and all(text.lower() in ("true", "false") for text in values):
        return pa.bool_()
    dates = [_DATE.fullmatch(text) for text in values]
    if dates and all(dates):
        return pa.timestamp("ns", tz="UTC" if any(date and date["zone"] for date in dates) else None)
    if any(not is_number(_point(text, dialect)) for text in values):
        return None
    whole = values and all(text.lstrip("-").isdigit() for text in values)
    if whole and max(abs(float(text)) for text in values) > _EXACT:
        return pa.int64()
    return pa.float64()
