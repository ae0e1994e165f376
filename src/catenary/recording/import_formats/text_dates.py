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
    r"(?P<clock>\d{1,2}:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)?(?P<half> ?[AaPp][Mm])?(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?"
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
        if self.order:
            order = _PLACES[self.order]
            text = pc.replace_substring_regex(text, r"^(\w+)[-/.](\w+)[-/.](\d+)(?:[t ._]+|$)", order)
            for month, name in enumerate(_MONTHS, 1):
                text = pc.replace_substring_regex(text, rf"-{name}[a-z]*-", f"-{month:02d}-")
            text = pc.replace_substring_regex(text, r"^(\d\d)-", r"20\1-")
            text = pc.replace_substring_regex(text, r"-(\d)-", r"-0\1-")
            text = pc.replace_substring_regex(text, r"-(\d) ", r"-0\1 ")
        else:
            text = pc.binary_join_element_wise("1970-01-01", text, " ")
        later = pc.if_else(pc.match_substring_regex(text, r"p\.?m\b"), _DAY // 2, 0)
        is_noon = pc.match_substring_regex(text, r" 12:.*[ap]m")
        later = pc.if_else(is_noon, pc.subtract(later, _DAY // 2), later)
        text = pc.replace_substring_regex(pc.replace_substring_regex(text, r" ?[ap]m", ""), r" (\d):", r" 0\1:")
        text = pc.utf8_trim_whitespace(pc.replace_substring(text, "z", "Z"))
        stamp = text.cast(pa.timestamp("ns", tz="UTC" if self.has_zone else None))
        return pc.add(stamp.cast(pa.int64()), later)


def date_format(texts: Sequence[str]) -> DateFormat | None:
    """Return how all of some texts are written; None where they are no dates.

    The order of day and month is told by a number above 12, by a year that comes first, by points between them
    (day first), or by the shorter of the two times that would have passed. What tells nothing is a doubt.
    """
    found = [_WRITTEN.fullmatch(text.strip()) for text in texts]
    matches = [one for one in found if one and (one["date"] or one["clock"])]
    if not matches or len(matches) != len(found):
        return None
    first = matches[0]
    if len({(bool(m["date"]), bool(m["clock"]), bool(m["zone"]), m["between"]) for m in matches}) > 1:
        return None
    has_clock, has_zone = bool(first["clock"]), bool(first["zone"])
    if not first["date"]:
        return DateFormat("", True, has_zone, False)
    if len(first["a"]) == 4:
        is_iso = first["between"] == "-" and not any(m["half"] or len(m["b"]) != 2 or len(m["c"]) != 2 for m in matches)
        is_iso = is_iso and not any("," in m.string or "_" in m.string for m in matches)
        return DateFormat("ymd", has_clock, has_zone, is_iso)
    if not first["b"].isdigit() or first["between"] == ".":
        return DateFormat("dmy", has_clock, has_zone, False)
    days = {(int(m["a"]), int(m["b"])) for m in matches if m["b"].isdigit()}
    if any(a > 12 for a, _ in days):
        return DateFormat("dmy", has_clock, has_zone, False)
    if any(b > 12 for _, b in days):
        return DateFormat("mdy", has_clock, has_zone, False)
    as_day_first, as_month_first = (_spread([(b, a) for a, b in days]), _spread(list(days)))
    if as_day_first != as_month_first:
        return DateFormat("dmy" if as_day_first < as_month_first else "mdy", has_clock, has_zone, False)
    a, b = sorted(days)[0]
    if a == b:
        return DateFormat("dmy", has_clock, has_zone, False)
    between = first["between"]
    doubt = f"{a}{between}{b} may be the {a}. of {_name(b)} or the {b}. of {_name(a)}, and nothing tells which"
    return DateFormat("dmy", has_clock, has_zone, False, doubt)


Carried = tuple[int, int | None]


def since_midnight(stamp: pa.Array, form: DateFormat, carried: Carried) -> tuple[pa.Array, Carried]:
    """Return stamps of times of day that go on beyond midnight, and of days in doubt without the day.

    Args:
        stamp: Of a block of rows [ns].
        form: Of the column.
        carried: What was added to the last block's last stamp [ns], and that stamp; (0, None) for the first block.
    """
    values = np.asarray(stamp.to_numpy(zero_copy_only=False))
    shift, last = carried
    if not len(values) or values.dtype.kind == "f":  # rows without: nothing to go by but the numbers
        return stamp, carried
    if form.doubt:
        shift = -(int(values[0]) // _DAY) * _DAY if last is None else shift
        return pa.array(values + shift), (shift, int(values[-1]))
    if form.order:
        return stamp, carried
    steps = np.diff(values, prepend=values[0] if last is None else last)
    turned = shift + _DAY * np.cumsum(steps < -_DAY // 2)
    return pa.array(values + turned), (int(turned[-1]), int(values[-1]))


def _spread(days: Sequence[tuple[int, int]]) -> int:
    """Return how far apart days (month, day) are."""
    numbers = [31 * month + day for month, day in days]
    return max(numbers) - min(numbers)


def _name(month: int) -> str:
    return _MONTHS[month - 1].capitalize()
