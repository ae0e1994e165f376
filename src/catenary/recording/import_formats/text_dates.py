"""Dates and times of day as people and programs write them, as nanoseconds."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from catenary.topics import SECOND

_DAY = 86_400 * SECOND  # [ns]
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
    """How the dates or times of day of a column are written."""

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
        half = [pc.match_substring_regex(text, each) for each in ("pm", r" 12:.*[ap]m")]
        later = pc.subtract(*(pc.if_else(each, _DAY // 2, 0) for each in half))
        text = pc.replace_substring_regex(pc.replace_substring_regex(text, r" ?[ap]m", ""), r" (\d):", r" 0\1:")
        text = pc.utf8_trim_whitespace(pc.replace_substring(text, "z", "Z"))
        stamp = text.cast(pa.timestamp("ns", tz="UTC" if self.has_zone else None))
        return pc.add(stamp.cast(pa.int64()), later)


def date_format(texts: Sequence[str]) -> DateFormat | None:
    """Return how all of some texts are written; None where they are no dates.

    The order of day and month is told by a year that comes first, a month by name, points (day first), a number above
    12, or the shorter of the two times that would have passed.
    """
    found = [
        match for text in texts if (match := _WRITTEN.fullmatch(text.strip())) and (match["date"] or match["clock"])
    ]
    if not found or len(found) != len(texts):
        return None
    if len({(bool(m["date"]), bool(m["clock"]), bool(m["zone"]), m["between"]) for m in found}) > 1:
        return None
    first, doubt, is_iso = found[0], "", False
    if not first["date"]:
        order = ""
    elif len(first["a"]) == 4:
        order = "ymd"
        iso = r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-][\d:]+)?)?"
        is_iso = all(re.fullmatch(iso, match.string.strip()) for match in found)
    elif not first["b"].isdigit() or first["between"] == ".":
        order = "dmy"
    else:
        days = sorted({(int(m["a"]), int(m["b"])) for m in found})
        largest = [max(each) for each in zip(*days, strict=True)]
        day_first, month_first = (
            max(d) - min(d) for d in ([31 * b + a for a, b in days], [31 * a + b for a, b in days])
        )
        order = "mdy" if largest[1] > 12 or (largest[0] <= 12 and month_first < day_first) else "dmy"
        (a, b), is_told = days[0], max(largest) > 12 or day_first != month_first or days[0][0] == days[0][1]
        if not is_told:
            one, other = (_MONTHS[each - 1].capitalize() for each in (b, a))
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
        shift = shift or -(int(last) // _DAY) * _DAY
        return pa.array(values + shift), (shift, int(values[-1]))
    turned = shift + _DAY * np.cumsum(np.diff(values, prepend=last) < -_DAY // 2)
    return pa.array(values + turned), (int(turned[-1]), int(values[-1]))
