"""Tables of text, as spreadsheets, MATLAB, NumPy, ROS and PlotJuggler write them: their dates, first lines, and rows.

Read in pieces, so that the memory that a table takes is that of the columns that are kept.
"""

import csv
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from catenary.bounded_parsers import cut, plain_number, reading
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.journal import About
from catenary.recording.parquet_files import ARROW, MOST_COLUMNS
from catenary.topics import SECOND

_DAY_NS = 86_400 * SECOND  # [ns]
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_WRITTEN = re.compile(
    r"(?P<date>(?P<a>\d{1,4})(?P<between>[-/.])(?P<b>\d{1,2}|[A-Za-z]{3,9})(?P=between)(?P<c>\d{4}|\d\d?))?"
    r"(?(date)(?:[T ,_]+|\Z))"
    r"(?P<clock>\d{1,2}:\d\d(?::\d\d(?:[.,:]\d{1,9})?)?)?(?P<half> ?[AaPp][Mm])?(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?"
)
_IN_WORDS = {"ymd": "year, month, day", "dmy": "day, month, year", "mdy": "month, day, year"}
_PLACES = {"ymd": r"\1-\2-\3 ", "dmy": r"\3-\2-\1 ", "mdy": r"\3-\1-\2 "}


@dataclass(frozen=True)
class DateFormat:
    """Format of a column's dates or times of day."""

    order: str  # "ymd", "dmy" or "mdy"; "" for times of day without a date
    has_clock: bool
    has_zone: bool
    is_iso: bool  # as Arrow reads it itself
    doubt: str = ""  # why the order of day and month is not known: the day is then left out

    def said(self, name: str) -> str:
        """Return in words how a column of this name is read."""
        if not self.order:
            return f"{name}: holds times of day, read as nanoseconds since midnight; they have no date"
        if self.doubt:
            return f"{name}: {self.doubt}; read as nanoseconds since that midnight, without a date"
        zone = "UTC" if self.has_zone else "no time zone, as if of UTC"
        order = "" if self.is_iso else f"{_IN_WORDS[self.order]}; "
        return f"{name}: holds dates, read as nanoseconds since 1970 ({order}{zone})"

    def nanoseconds(self, column: pa.Array) -> pa.Array:
        """Return int64 of texts, null where one is none."""
        text = pc.replace_substring(pc.utf8_lower(pc.utf8_trim_whitespace(column)), ",", ".")
        text = pc.replace_substring_regex(text, r"(:\d\d:\d\d):", r"\1.")  # before milliseconds
        if self.order:
            ordered = (r"^(\w+)[-/.](\w+)[-/.](\d+)(?:[t ._]+|$)", _PLACES[self.order])
            months = [(rf"-{name}[a-z]*-", f"-{month:02d}-") for month, name in enumerate(_MONTHS, 1)]
            digits = [(r"^(\d\d)-", r"20\1-"), (r"-(\d)-", r"-0\1-"), (r"-(\d) ", r"-0\1 ")]
            for written, meant in [ordered, *months, *digits]:
                text = pc.replace_substring_regex(text, written, meant)
        else:
            text = pc.binary_join_element_wise("1970-01-01", text, " ")
        half = [pc.match_substring_regex(text, pattern) for pattern in ("pm", r" 12:.*[ap]m")]
        later = pc.subtract(*(pc.if_else(mask, _DAY_NS // 2, 0) for mask in half))
        text = pc.replace_substring_regex(pc.replace_substring_regex(text, r" ?[ap]m", ""), r" (\d):", r" 0\1:")
        text = pc.utf8_trim_whitespace(pc.replace_substring(text, "z", "Z"))
        stamp = text.cast(pa.timestamp("ns", tz="UTC" if self.has_zone else None))
        return pc.add(stamp.cast(pa.int64()), later)


def date_format(texts: Sequence[str]) -> DateFormat | None:
    """Return the common date format of some texts; None if they are no dates.

    The order of day and month is inferred from a year that comes first, a month by name, points (day first), a number
    above 12, or the shorter of the two times that would have passed.
    """
    formats = [
        match for text in texts if (match := _WRITTEN.fullmatch(text.strip())) and (match["date"] or match["clock"])
    ]
    if not formats or len(formats) != len(texts):
        return None
    if len({(bool(m["date"]), bool(m["clock"]), bool(m["zone"]), m["between"]) for m in formats}) > 1:
        return None
    first, doubt, is_iso = formats[0], "", False
    if not first["date"]:
        order = ""
    elif len(first["a"]) == 4:
        order = "ymd"
        iso = r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-][\d:]+)?)?"
        is_iso = all(re.fullmatch(iso, match.string.strip()) for match in formats)
    elif not first["b"].isdigit() or first["between"] == ".":
        order = "dmy"
    else:
        days = sorted({(int(m["a"]), int(m["b"])) for m in formats})
        largest = [max(numbers) for numbers in zip(*days, strict=True)]
        day_first, month_first = (
            max(d) - min(d) for d in ([31 * b + a for a, b in days], [31 * a + b for a, b in days])
        )
        order = "mdy" if largest[1] > 12 or (largest[0] <= 12 and month_first < day_first) else "dmy"
        (a, b), is_told = days[0], max(largest) > 12 or day_first != month_first or days[0][0] == days[0][1]
        if not is_told:
            one, other = (_MONTHS[month - 1].capitalize() for month in (b, a))
            doubt = f"{a}/{b} may be the {a}. of {one} or the {b}. of {other}, and nothing tells which"
    return DateFormat(order, bool(first["clock"]), bool(first["zone"]), is_iso, doubt)


Carried = tuple[int, int | None]  # what was added to the last stamp [ns], and that stamp; (0, None) at first


def since_midnight(stamp: pa.Array, form: DateFormat, carried: Carried) -> tuple[pa.Array, Carried]:
    """Return a block's stamps [ns]: times of day that go on beyond midnight, days in doubt without the day."""
    values = stamp.to_numpy(zero_copy_only=False)
    if not len(values) or values.dtype.kind == "f" or (form.order and not form.doubt):  # rows without: as they are
        return stamp, carried
    shift, last = carried
    last = values[0] if last is None else last
    if form.doubt:
        shift = shift or -(int(last) // _DAY_NS) * _DAY_NS
        return pa.array(values + shift), (shift, int(values[-1]))
    turned = shift + _DAY_NS * np.cumsum(np.diff(values, prepend=last) < -_DAY_NS // 2)
    return pa.array(values + turned), (int(turned[-1]), int(values[-1]))


# cells without a number: as MATLAB and spreadsheets write them, and C by Microsoft (1.#QNAN, -1.#IND00, -nan(ind))
_OF_C = [f"1{point}#{name}{'0' * k}" for point in ".," for name in ("QNAN", "SNAN", "IND", "INF") for k in range(13)]
_OF_C += ["1.#J", "1.#R", "1.#IO", "1.#QO", "nan", "nan(ind)", "nan(snan)"]  # the first ones rounded to few decimals
_MISSING_CELLS = frozenset(["", "NaN", "NAN", "NA", "N/A", "null", "None", "none", "Missing", "MISSING", "missing",
                            "#N/A", "#DIV/0!", "#NUM!", "#VALUE!", "#REF!", *_OF_C,
                            *(f"-{cell}" for cell in _OF_C)])  # fmt: skip
_TRUTH_CELLS = {"true", "false"}
NAMELESS_ARRAY = "data"  # whose elements, data[0], data[1], ..., columns without names are called, as of a .npy
_EXACT = 2.0**53  # from which a float64 has not every whole number
_COMMENT = re.compile(r"\s*(#|%|//)[#%/\s]*")
_UNIT = re.compile(
    r"[\[(]?\s*(|-|1|s|sec|ms|us|µs|ns|rad|deg|°|m|mm|cm|um|nm|n|a|ma|v|hz|counts?|ticks?"
    r"|(rad|deg|m|mm|n\*?m|°)(/|\*)s(\^?[23]|²)?|[mck]?n([*.·]?[mc]?m)?)\s*[\])]?",
    re.IGNORECASE,
)
_BRACKETS = re.compile(r"(.*?)(\s*[\[(].*)?", re.DOTALL)  # a name, and its unit or index
_ARRAY = re.compile(r"[\[(]\s*([-+\d.eEnaN]+(?:\s*[,;\s]\s*[-+\d.eEnaN]+)*)\s*[\])]")  # of numbers, in a cell
_MIN_NUMBERS = 20  # numbers that tell with how many digits a column is written
_ROS_SECONDS = (946_684_800, 4_200_000_000)  # [s] since 1970 that a stamp of ROS has: the years 2000 to 2100

Kind = Literal["number", "whole", "truth", "date", "text"]


class TextDialect(NamedTuple):
    """Separator of columns, and decimal separator."""

    separator: str  # " " for any number of blanks
    decimal: str

    def split(self, line: str) -> list[str]:
        """Return the cells of a line."""
        if self.separator == " ":
            return [cell.strip('"') for cell in line.split()]
        return [cell.strip() for cell in next(csv.reader(islice([line], 1), delimiter=self.separator), [])]

    def is_value(self, cell: str) -> bool:
        """Return True if a cell may stand in a column of numbers, an empty one too; 20260311_235958 may not."""
        with suppress(ValueError):
            plain_number(cell.replace(",", ".") if self.decimal == "," else cell)
            return True
        return cell in _MISSING_CELLS or _ARRAY.fullmatch(cell) is not None


class TextColumn(NamedTuple):
    """A column of a text table, and how its cells are read."""

    name: str
    kind: Kind
    places: tuple[int, ...]  # of its cells in a row: two of a date and its time of day, or of seconds and nanoseconds
    date: DateFormat | None = None
    odd: str = ""  # the first cell of a column of text, where others are numbers, and its line
    element: int | None = None  # of the array in each cell


class TextHead(NamedTuple):
    """Format of a text table."""

    dialect: TextDialect
    width: int  # cells of a row, empty ones at the end included
    begins: int  # lines before the first row
    columns: tuple[TextColumn, ...]
    is_named: bool
    joints: dict[str, tuple[str, ...]]
    heads: tuple[str, ...]  # lines above the rows that are no comments: behind them they begin another recording
    torn: str  # the last line, where it was not written to its end
    notes: tuple[str, ...]


def read_head(where: str, lines: Sequence[str], last: Sequence[str] = (), unended: str = "") -> TextHead:
    """Infer the layout of a text table from its first lines, its last ones if not among them, and one `unended`.

    Comment lines begin with #, % or //. Rows begin where a line has the usual number of cells, and none that is text
    above numbers. The line of names is the last line before them, or the last comment, that has a cell for each
    column; a line of units behind it goes into the names. A table without names has `data[0]`, `data[1]`, ...
    """
    lines = [*lines, unended] if len(lines) < 2 and unended else lines  # a head and one row
    lines = [lines[0].lstrip("\ufeff"), *lines[1:]] if lines else []
    plain = [k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)]
    if not plain:
        raise FileFormatError(f"{where}: expected a line of names, if any, and lines of numbers, got no line")
    body = [*(lines[k] for k in plain[len(plain) // 2 :]), *(line for line in last if not _COMMENT.match(line))]
    dialect = _dialect(body)
    widths = Counter(len(dialect.split(line)) for line in body)
    width = max(widths, key=lambda each: (widths[each], each))
    if width > MOST_COLUMNS:
        raise FileFormatError(f"{where}: {width} columns, expected {MOST_COLUMNS} at most")
    tail = [cells for line in body if len(cells := dialect.split(line)) == width]
    begins = next((k for k in plain if _is_row(dialect.split(lines[k]), tail, dialect)), None)
    heads = [line for line in lines[:begins] if line.strip()]
    if begins is None:
        raise FileFormatError(f"{where}: no column of numbers among {', '.join(map(cut, tail[0][:10]))}")
    counted = [*map(str, range(width))]
    if not heads and width > 2 and dialect.split(lines[begins]) in (counted, ["", *counted[:-1]]):
        begins += 1  # pandas' names of columns that have none
    names_above = tuple(line.strip() for line in heads if not _COMMENT.match(line))
    rows = [(k + 1, dialect.split(lines[k])) for k in plain if k >= begins and lines[k].strip() not in names_above]
    rows += [(0, dialect.split(line)) for line in last if not _COMMENT.match(line) and line.strip() not in names_above]
    used = width
    named = {len(cells) for line in heads if (cells := dialect.split(line))[-1:] != [""]}
    while used > 1 and used not in named and all(len(row) < used or not row[used - 1] for _, row in rows):
        used -= 1  # a separator at the end of each line
    names, notes = _names(heads, used, rows, dialect)
    unique, twice = _unique(names or [f"{NAMELESS_ARRAY}[{i}]" for i in range(used)])
    columns = [_column(unique[i], (i,), [(k, row[i]) for k, row in rows if i < len(row)], dialect) for i in range(used)]
    columns = [part for column in columns for part in _elements(column, rows)]
    joints: dict[str, tuple[str, ...]] = {}
    if not names:
        columns, joints = _as_echoed(columns, rows)
    columns = _dates_with_clocks(columns, [row for _, row in rows])
    if names and not names[0] and columns[0].kind == "date" and "time" not in unique:
        columns[0] = TextColumn("time", "date", columns[0].places, columns[0].date)
    if all(column.kind == "text" for column in columns):
        raise FileFormatError(f"{where}: no column of numbers among {', '.join(map(cut, unique[:10]))}")
    notes += twice
    if not names:
        called = f"{columns[0].name} to {columns[-1].name}" if len(columns) > 1 else columns[0].name
        echoed = ", and its rows begin with seconds and nanoseconds as ros2 topic echo --csv prints them"
        own = echoed if len(columns[0].places) == 2 and columns[0].kind == "whole" else ""
        notes.append(f"has no line of names{own}: its columns are called {called}")
    texts = [f"{cut(c.name)}{f' ({c.odd})' if c.odd else ''}" for c in columns if c.kind == "text"]
    notes += [f"columns of text were left out: {', '.join(texts[:10])}"] * bool(texts)
    notes += [column.date.said(cut(column.name)) for column in columns if column.date is not None]
    if dialect != (",", "."):
        separator = {"\t": "tabs", " ": "spaces"}.get(dialect.separator, f'"{dialect.separator}"')
        notes.append(f'columns are separated by {separator}, decimals by "{dialect.decimal}"')
    above = [row for _, row in rows if len(row) == width]
    torn = unended if _is_torn(dialect.split(unended), columns, above, dialect) else ""
    return TextHead(dialect, width, begins, tuple(columns), bool(names), joints, names_above, torn, tuple(notes))


def _dialect(lines: Sequence[str]) -> TextDialect:
    """Infer the separator of columns: the one by which most cells are numbers."""
    dialects: list[tuple[float, TextDialect]] = []
    for dialect in (TextDialect(*signs) for signs in (";.", "\t.", ",.", " .", ";,", "\t,", " ,")):
        rows = [dialect.split(line) for line in lines[: max(3, min(50, 100_000 // len(max(lines, key=len))))]]
        if sorted(map(len, rows))[len(rows) // 2] < 2:
            continue
        cells = [cell for row in rows for cell in row]
        good = sum(dialect.is_value(cell) or date_format([cell]) is not None for cell in cells) / len(cells)
        ragged = len({len(row) for row in rows}) > 1
        dialects.append((good - 0.5 * ragged, dialect))
    return max(dialects, key=lambda each: each[0])[1] if dialects else TextDialect(",", ".")


def _is_row(cells: Sequence[str], tail: Sequence[Sequence[str]], dialect: TextDialect) -> bool:
    """Return True if a line is of the table: as wide, and no text where most of the last lines have a value."""
    if len(cells) != len(tail[0]):
        return False

    def is_value(cell: str) -> bool:
        return bool(cell) and (
            dialect.is_value(cell) or date_format([cell]) is not None or cell.lower() in _TRUTH_CELLS
        )

    below = [sum(is_value(row[i]) for row in tail) > len(tail) / 2 for i in range(len(cells))]
    return any(below) and all(is_value(cell) or not cell for cell, number in zip(cells, below, strict=True) if number)


def _is_torn(
    cells: Sequence[str], columns: Sequence[TextColumn], above: Sequence[Sequence[str]], dialect: TextDialect
) -> bool:
    """Return True if a line lacks cells of those above, has one of another kind, or ends in fewer digits."""
    numbers = [place for column in columns if column.kind in ("number", "whole") for place in column.places]
    if not above or len(cells) != len(above[0]) or not all(dialect.is_value(cells[place]) for place in numbers):
        return True

    def digits(cell: str) -> int:
        return sum(map(str.isdigit, cell.partition(dialect.decimal)[2] or cell))

    written = [digits(row[-1]) for row in above if row[-1] not in _MISSING_CELLS]
    is_number = len(cells) - 1 in numbers and cells[-1] not in _MISSING_CELLS
    return is_number and len(written) >= _MIN_NUMBERS and digits(cells[-1]) < min(written)


def _names(
    heads: Sequence[str], used: int, rows: Sequence[tuple[int, list[str]]], dialect: TextDialect
) -> tuple[list[str], list[str]]:
    """Return a name for each column, and what there is to say; no names where no line has one for each."""
    titles = [line for line in heads if re.search(r"\w", line)][-2:]
    cells_of_lines = [_words(_COMMENT.sub("", line, count=1), used, dialect) for line in titles]
    if not cells_of_lines:
        return [], []
    *above, cells = cells_of_lines
    units = [""] * used
    if used > 1 and len(cells) == used and all(map(_UNIT.fullmatch, cells)) and above and len(above[0]) == used:
        cells, units = above[0], [cell.strip("[]() ") for cell in cells]
    texts = [cell for cell in cells if cell and not dialect.is_value(cell)]
    if len(cells) == used and len(texts) >= used / 2:
        behind = [f" [{unit}]" * (unit not in ("", "-", "1")) for unit in units]
        return [name + unit * (not set(name) & set("[(")) for name, unit in zip(cells, behind, strict=True)], []
    is_merged = cells[:1] == texts[:1] and 1 < len(texts) < len(cells) <= used  # cells of a spreadsheet
    if is_merged and not any(text[-1].isdigit() for text in texts):  # q3 is of one column
        begins = [i for i, cell in enumerate(cells) if cell] + [used]
        return [f"{cells[a]}[{i}]" if b > a + 1 else cells[a] for a, b in pairwise(begins) for i in range(b - a)], []
    cells = [cell for cell in cells if cell]
    few = f"{len(cells)} names for {used} columns ({', '.join(map(cut, cells[:5]))}, ...): none was taken"
    is_prose = _COMMENT.match(titles[-1]) and len(cells) < used / 2
    return [], [few] * (len(cells) > 1 and len(texts) == len(cells) and not is_prose)


def _words(line: str, used: int, dialect: TextDialect) -> list[str]:
    """Return the cells of a line above the rows, by the separator that makes as many as a row has."""
    ways = (dialect.separator, ",", ";", "\t", " ") if dialect.separator != " " else (",", ";", "\t", " ")
    split = [TextDialect(separator, ".").split(line) for separator in ways]
    split.append(re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", line))  # q1 [rad] q2 [rad]
    rows = [cells[:used] if not any(cells[used:]) else cells for cells in split]
    return next((cells for cells in rows if len(cells) == used), dialect.split(line))


def _unique(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return names that differ, and a note on those that did not."""
    seen, unique, taken, note = Counter[str](), list[str](), set(names), ""
    for new in (name or f"column{i + 1}" for i, name in enumerate(names)):
        name = new
        seen[name] += 1
        stem, unit = _BRACKETS.fullmatch(name).groups("")  # type: ignore[union-attr]  # any text is
        while seen[name] > 1 and (new := f"{stem}#{seen[name]}{unit}") in taken:
            seen[name] += 1
        note = note or f"names that are there more than once are numbered, such as {cut(new)}" * (new != name)
        taken.add(new)
        unique.append(new)
    return unique, [note] * bool(note)


def _column(name: str, places: tuple[int, ...], cells: Sequence[tuple[int, str]], dialect: TextDialect) -> TextColumn:
    """Return the parser of a column, inferred from some of its cells and their lines."""
    values = [(line, text) for line, cell in cells if (text := cell.strip('"')) not in _MISSING_CELLS]
    texts = [text for _, text in values]
    if texts and {text.lower() for text in texts} <= _TRUTH_CELLS:
        return TextColumn(name, "truth", places)
    form = date_format(texts)
    if form is not None:
        return TextColumn(name, "date", places, form)
    strange = [(line, text) for line, text in values if _ARRAY.fullmatch(text) or not dialect.is_value(text)]
    if strange:
        line, text = strange[0]
        odd = f'{f"line {line}" if line else "in its last lines"}: "{cut(text)}"' if len(strange) < len(values) else ""
        return TextColumn(name, "text", places, odd=odd)
    numbers = [text.replace(",", ".") if dialect.decimal == "," else text for text in texts]
    whole = all(n.lstrip("-").isdigit() for n in numbers)
    if numbers and whole and _EXACT < max(abs(float(n)) for n in numbers) < 2.0**63:
        return TextColumn(name, "whole", places)
    return TextColumn(name, "number", places)


def _elements(column: TextColumn, rows: Sequence[tuple[int, list[str]]]) -> list[TextColumn]:
    """Return a column for each element where every cell is an array of as many: [0.1, 0.2]; else it alone."""
    cells = [row[place] for _, row in rows for place in column.places if place < len(row)]
    arrays = [_ARRAY.fullmatch(cell.strip('"')) for cell in cells if cell not in _MISSING_CELLS]
    counts = {len(re.split(r"[,;\s]+", array[1])) if array else 0 for array in arrays}
    if len(counts) != 1 or counts == {0}:
        return [column]
    return [TextColumn(f"{column.name}[{k}]", "number", column.places, element=k) for k in range(*counts)]


def _dates_with_clocks(columns: Sequence[TextColumn], rows: Sequence[Sequence[str]]) -> list[TextColumn]:
    """Return columns with a day and the time of day behind it as one."""
    dated: list[TextColumn] = []
    for column in columns:
        day, clock, both = (dated[-1].date if dated else None), column.date, None
        if day is not None and clock is not None and day.order and not day.has_clock and not clock.order:
            places = (*dated[-1].places, *column.places)
            whole = [row for row in rows if all(i < len(row) and row[i] for i in places)]
            both = date_format([" ".join(row[i] for i in places) for row in whole])
        if both is None:  # of a day and a time that no row has, too
            dated.append(column)
        else:
            dated[-1] = TextColumn(dated[-1].name, "date", places, both)
    return dated


def _as_echoed(
    columns: Sequence[TextColumn], rows: Sequence[tuple[int, list[str]]]
) -> tuple[list[TextColumn], dict[str, tuple[str, ...]]]:
    """Return columns by a message's names, where rows are those of `ros2 topic echo --csv`, a JointState's by joint."""
    first = [row for _, row in rows if len(row) >= len(columns)]
    stamps = [row[:2] for row in first]
    if len(columns) < 4 or not all(
        a.isdigit() and b.isdigit() and _ROS_SECONDS[0] < int(a) < _ROS_SECONDS[1] and int(b) < 10**9 for a, b in stamps
    ):
        return list(columns), {}
    stamp = TextColumn("stamp", "whole", (0, 1))
    names = [i for i in range(3, len(columns)) if columns[i].kind == "text"]
    n, behind = len(names), len(columns) - 3 - len(names)
    constant = all(len({row[i] for row in first}) == 1 for i in names)
    if n < 1 or names != list(range(3, 3 + n)) or not constant or behind not in (n, 3 * n):
        frame = [] if columns[2].kind == "text" or not any(row[2] for row in first) else [columns[2]]
        return [stamp, *frame, *columns[3:]], {}
    joints = tuple(first[0][i] for i in names)
    arrays = ("position", "velocity", "effort")[: behind // n]
    echoed = [stamp]
    for k, array in enumerate(arrays):
        echoed += [TextColumn(f"{array}[{joint}]", "number", (3 + (k + 1) * n + j,)) for j, joint in enumerate(joints)]
    return echoed, dict.fromkeys(arrays, joints)


_MAX_LINE_BYTES = 1_000_000  # characters
_SAMPLED_NUMBERS = 4_000_000  # of a table that is not held whole that are looked at
_LOOKED_AT_LINES = 200  # lines by which separator, decimal sign and kinds of columns are inferred
_TAIL_BYTES = 65_536  # [B] at the end of a file that are looked at, too
_BLOCK_BYTES = 4 << 20  # [B] that are read at a time
_COMMENTS = "comment lines among the rows were passed over"
_BEGINS = (b"#", b"%", b"//")  # of comments
_TYPES: Mapping[str, Any] = {"number": pa.float64(), "whole": pa.int64(), "truth": pa.bool_()}


class TextTable:
    """A table of text whose head was read; its rows are read when they are wanted."""

    about: About | None = None
    first_arrival = 0

    def __init__(self, path: Path, progress: Callable[[float], object] = lambda done: None) -> None:
        """Read its first and last lines; `progress` is called with the share of the file that was read."""
        self.path, self._size, self._progress = path, path.stat().st_size, progress
        lines, ends, last, unended = _lines(path)
        self.head: TextHead = read_head(str(path), lines, last, unended)
        self._first_byte = ends[self.head.begins - 1] if self.head.begins else 0
        head, rows = self._first_byte, len(ends) - self.head.begins
        self._about_rows = round((self._size - head) / max(1.0, (ends[-1] - head) / rows)) if rows else 0
        self.counts = {path.stem: self._about_rows}
        self.notes = list(self.head.notes)  # and, once it was read, on rows that were passed over

    @property
    def problems(self) -> list[str]:
        """What was found among the rows; complete once they were read."""
        return [f"{self.path.stem}: {note}" for note in self.notes[len(self.head.notes) :]]

    def sample(self) -> list[Stream]:
        """Return its first rows."""
        held, count = list[Stream](), 0
        for part in self.streams():
            held.append(part)
            count += part.rows * len(part.columns)
            if count >= _SAMPLED_NUMBERS:
                break
        stream = joined(held)
        notes = (*stream.notes, f"of about {self._about_rows} rows the first {stream.rows} were looked at")
        return [replace(stream, rows=self._about_rows, notes=notes)]

    def parts(self, requested: Mapping[str, Collection[str]]) -> Iterator[list[Stream]]:
        """Yield columns, some thousand rows at a time."""
        return ([part] for part in self.streams(requested[self.path.stem]))

    def streams(self, requested: Collection[str] | None = None) -> Iterator[Stream]:
        """Yield the columns of numbers, or those of them that are wanted, some thousand rows at a time.

        Dates are nanoseconds; whole numbers that no float64 can hold stay whole.
        """
        dates = tuple(column.name for column in self.head.columns if column.date is not None)
        options: dict[str, Any] = {"joints": self.head.joints, "dates": dates, "notes": tuple(self.head.notes)}
        columns = [c for c in self.head.columns if c.kind != "text" and (requested is None or c.name in requested)]
        kinds = {str(place): _arrow_type(column) for column in columns for place in column.places}
        names = [str(i) for i in range(self.head.width)]
        # Arrow's pool of threads aborts one process in a hundred as it ends
        read = pa.csv.ReadOptions(use_threads=False, column_names=names, block_size=4 * _BLOCK_BYTES)
        passed = Counter[str]()
        parse = pa.csv.ParseOptions(delimiter=self.head.dialect.separator)
        convert = pa.csv.ConvertOptions(
            column_types=kinds, include_columns=list(kinds), null_values=list(_MISSING_CELLS), strings_can_be_null=True,
            decimal_point=self.head.dialect.decimal,
            true_values=["true", "True", "TRUE"], false_values=["false", "False", "FALSE"],
        )  # fmt: skip
        carried: dict[str, tuple[int, int | None]] = {}
        with reading(self.path, "CSV", ARROW), self.path.open("rb") as file:
            file.seek(self._first_byte)
            for rows in self._rows(file, passed):
                batches = pa.csv.read_csv(pa.BufferReader(rows), read, parse, convert).combine_chunks().to_batches()
                if requested is not None:  # not of a sample
                    self._progress(min(1.0, file.tell() / self._size))
                for batch in batches:
                    numbers = {column.name: _numbers(column, batch, carried) for column in columns}
                    yield Stream(self.path.stem, "table", numbers, batch.num_rows, **options)
        notes = [f"{count} {what}" for what, count in passed.items() if count]
        notes += ["its last line is torn, and was left out"] * bool(self.head.torn)
        self.notes += [note for note in notes if note not in self.notes]

    def _rows(self, file: BinaryIO, passed: Counter[str]) -> Iterator[bytes]:
        """Yield some MB of rows at a time: without comments, heads that come again, and a torn last line."""
        heads = {head.encode() for head in self.head.heads}
        begins = [b"\n" + begin for begin in (*_BEGINS, *heads)]
        is_blank, left = self.head.dialect.separator == " ", b""
        while True:
            block = file.read(_BLOCK_BYTES)
            data = left + block
            end = data.rfind(b"\n") + 1 if block or self.head.torn else len(data)
            data, left = data[:end], data[end:]
            if is_blank or any(begin in data for begin in begins) or data.startswith((*_BEGINS, *heads)):
                lines = []
                for line in data.split(b"\n"):
                    bare = line.strip()
                    if bare.startswith(_BEGINS):
                        passed[_COMMENTS] += 1
                    elif bare in heads:
                        passed["lines of names among the rows were passed over"] += 1
                    else:
                        lines.append(b" ".join(line.split()) if is_blank else line)
                data = b"\n".join(lines)
            if data.strip():
                yield data
            if not block:
                return


def _arrow_type(column: TextColumn) -> pa.DataType:
    if column.element is not None:
        return pa.string()
    if column.date is not None:
        zone = "UTC" if column.date.has_zone else None
        return pa.timestamp("ns", tz=zone) if column.date.is_iso and len(column.places) == 1 else pa.string()
    return _TYPES[column.kind]


def _numbers(column: TextColumn, batch: pa.RecordBatch, carried: dict[str, tuple[int, int | None]]) -> NDArray[Any]:
    """Return a column's cells in a batch as numbers; NaN if there is none."""
    cells = [batch.column(str(place)) for place in column.places]
    one = cells[0]
    if column.element is not None:
        parts = pc.split_pattern_regex(pc.utf8_trim(one, "[]() \t"), r"[,;\s]+")
        one = pc.list_element(parts, column.element).cast(pa.float64())
    elif column.kind == "whole" and len(cells) == 2:  # seconds and nanoseconds
        one = pc.add(pc.multiply(cells[0], SECOND), cells[1])
    elif column.date is not None and pa.types.is_timestamp(one.type):
        one = one.cast(pa.int64())
    elif column.date is not None:
        one = column.date.nanoseconds(one if len(cells) == 1 else pc.binary_join_element_wise(*cells, " "))
        one, carried[column.name] = since_midnight(one, column.date, carried.get(column.name, (0, None)))
    values: NDArray[Any] = one.to_numpy(zero_copy_only=False)
    return values if values.dtype.kind == "i" else values.astype(np.float64)


def _lines(path: Path) -> tuple[list[str], list[int], list[str], str]:
    """Return a file's first lines, where each ends [B], its last lines, and apart the very last if it has no end."""
    try:
        with path.open("rb") as file:
            lines = [file.readline(_MAX_LINE_BYTES + 1) for _ in range(_LOOKED_AT_LINES)]
            end, size = file.tell(), path.stat().st_size
            file.seek(max(end, size - _TAIL_BYTES))
            behind = file.read()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
    if any(len(line) > _MAX_LINE_BYTES for line in lines):
        raise FileFormatError(f"{path}: a line of more than {_MAX_LINE_BYTES} bytes; is this a CSV?")
    if lines[0][:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError(f"{path}: is UTF-16, expected UTF-8")
    if any(b"\0" in line for line in lines):
        raise FileFormatError(f"{path}: holds bytes that are no text, expected CSV")
    if any(b"\r" in line.rstrip(b"\r\n") for line in lines):
        raise FileFormatError(f"{path}: its lines end in carriage returns alone, expected line feeds")
    ends = np.cumsum([len(line) for line in lines]).tolist()
    last = behind.split(b"\n")[1 if size - _TAIL_BYTES > end else 0 :]
    try:
        first = [line.decode().rstrip("\r\n") for line in lines if line]
        texts = [line.decode(errors="replace").rstrip("\r\n") for line in last]
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: is no UTF-8 text: {error}") from error
    is_unended, where = not (behind or b"".join(lines)).endswith(b"\n"), texts if behind else first
    unended = where.pop() if is_unended and where else ""
    return first, ends, [text for text in texts if text.strip()], unended
