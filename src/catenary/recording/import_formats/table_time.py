"""The time of a table's rows: which column holds it, and in which unit.

Whole numbers may count anything, such as the ticks of 4 kHz: a name or a known clock tells their unit, or it is asked.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from catenary.arrays import Integers
from catenary.bounded_parsers import cut
from catenary.errors import InputError
from catenary.plant import FIRST_DATE_S
from catenary.recording.import_formats.columns import Stream, places_of
from catenary.topics import SECOND

UNITS = ("s", "ms", "us", "ns")
_PER_SECOND = {unit: Fraction(1000**i) for i, unit in enumerate(UNITS)}
_PER_SECOND |= {"100ns": Fraction(10**7), "2^-32s": Fraction(2**32), "day": Fraction(1, 86_400)}
_SPELT = {
    f"{part}{word}": unit
    for unit, parts in zip(UNITS, (("",), ("m", "milli"), ("u", "µ", "micro"), ("n", "nano")), strict=True)
    for part in parts
    for word in ("seconds", "second", "secs", "sec", "s")
}
_NAMED = re.compile(
    r"(?P<name>(?:.*[./_ ])?(?:time|times|ts|t|stamp|timestamp|timestamps|time_?stamp|clock|sec|secs|seconds|zeit))"
    rf"(?:(?!s\Z)[_ ]?[\[(]?(?P<unit>{'|'.join(_SPELT)})[\])]?)?\Z",
    re.IGNORECASE,
)


def per_second(unit: str) -> Fraction:
    """Return the number of a unit in a second; of a counter such as 4000Hz its rate."""
    match = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)Hz", unit)
    count = Fraction(match[1]) if match else _PER_SECOND.get(unit)
    if not count:
        raise InputError(f"time unit {cut(unit)}: expected {', '.join(_PER_SECOND)}, or a counter's such as 4000Hz")
    return count


TimeUnit = Annotated[str, AfterValidator(lambda unit: per_second(unit) and unit)]
# [s] of a step between rows: 2 kHz to 0.2 Hz, which is how slowly poses are taken one by one
_LIKELY_STEP_S = (0.0005, 5.0)
_FIRST_DATE_S, _DAY_S = 946_684_800, 86_400  # [s] since 1970 of the year 2000, before which nobody recorded; a day
_UNDATED_S = 10**8  # [s] whole ones of which are taken off a clock that is none of those known, lest it be a date's


class _Clock(NamedTuple):
    unit: str
    zero: int  # [s since 1970]
    name: str


_CLOCKS = (
    *(_Clock(unit, 0, "a time since 1970") for unit in UNITS),
    _Clock("100ns", -11_644_473_600, "since 1601, FILETIME"),  # of Windows
    _Clock("100ns", -62_135_596_800, "since year 1, ticks of .NET"),
    _Clock("s", -2_208_988_800, "since 1900, as NTP"),
    _Clock("2^-32s", -2_208_988_800, "since 1900, as NTP"),
    _Clock("s", -2_082_844_800, "since 1904, as LabVIEW"),
    _Clock("day", -25_569 * _DAY_S, "days since 30 December 1899, as Excel"),
    _Clock("day", -719_529 * _DAY_S, "days since year 0, datenum of MATLAB"),
)
# single numbers of a file that say how many rows a second has, as labs, cameras and simulators call them
RATES = ("fs", "rate", "rate_hz", "sampling_rate", "sample_rate", "frequency", "fps", "hz", "control_freq")
_LOST_NS = np.iinfo(np.int64).min  # stamp of a row without time
_RISING_ROWS = 100  # rows over which no joint moves one way alone
_COARSE_SHARE = 2 / 3  # share of rows that have the time of the row before, while most columns change
_LOOKED_AT_ROWS = 10_000  # rows, for that
# what stands at the end of a name of whole seconds, and of one beside it of the rest of each stamp [ns]
_SECONDS = re.compile(r"(?:secs?|seconds|s)\Z", re.IGNORECASE)
_RESTS = {word: int(SECOND / per_second(unit)) for word, unit in _SPELT.items() if unit != "s"}


class CoarseTimeError(InputError):
    """Rows were taken faster than their time was written."""


class TableTime(NamedTuple):
    """Stamps of a table's rows."""

    stamp: Integers  # (M,) [ns], as in the file; NaN's rows hold the least number
    column: str | None  # "" where rows are evenly apart; None if they have no time
    unit: str
    said: str  # how it was found, for the reader
    seconds: NDArray[np.float64] | None = None  # (M,) as exact as the file has them, where it has no whole numbers


def time_of(
    stream: Stream, columns: Sequence[str], unit: str | None, rate: float | None, *, today: float
) -> TableTime | None:
    """Return the stamps of a table's rows; None if it has none.

    Args:
        stream: The table.
        columns: Columns of time.
        unit: Unit, or a name of it; inferred when None.
        rate: Rate of rows without time [Hz].
        today: Latest time that a clock can show, but for a day of time zones [s since 1970].

    Raises:
        InputError: Both columns and rate are given.
    """
    if rate is not None:
        if columns:
            raise InputError("time and rate_hz: expected one of them")
        return _even(stream, rate, f"rows were given {rate:g} Hz")
    column = _given(stream, columns)
    if column is None:
        named = time_columns(stream)
        if len(named) > 1:
            raise InputError(
                f"{stream.name}: time may be {' or '.join(map(cut, named))}; say which (--map time=COLUMN)"
            )
        if not named:
            constant = next((name for name in RATES if name in stream.constants), None)
            if constant is None:
                return None
            rate = stream.constants[constant]
            return _even(stream, rate, f"rows were taken at the file's {constant}, {rate:g} Hz")
        column = named[0]
    values = stream.columns[column]
    fraction = rest_of(stream, column)
    if fraction is not None:
        name, size = fraction
        stamp, date = _stamps(values, "s", _clocks_of(values, today, "s"))
        parts = stream.columns[name].astype(np.float64) * size
        there = (stamp != _LOST_NS) & np.isfinite(parts)
        stamp = np.where(there, stamp + np.rint(np.where(there, parts, 0.0)).astype(np.int64), _LOST_NS)
        note = f"time is {cut(column)} in s and {cut(name)} in {size} ns{f' ({date})' * bool(date)}"
        return TableTime(stamp, column, "s", note)
    _refuse_coarse(stream, column, unit, today)
    found_unit, why = (unit, "as given") if unit is not None else _unit(stream, column, values, today)
    stamp, date = _stamps(values, found_unit, () if column in stream.dates else _clocks_of(values, today, found_unit))
    note = f"time is {cut(column)} in {found_unit} ({'; '.join(dict.fromkeys((why, date) if date else (why,)))})"
    if values.dtype.kind == "i":
        return TableTime(stamp, column, found_unit, note)
    return TableTime(stamp, column, found_unit, note, values.astype(np.float64) / float(per_second(found_unit)))


def rest_of(stream: Stream, column: str) -> tuple[str, int] | None:
    """Return the column of what a time has beyond whole seconds, nsec beside sec as in ROS, and its unit [ns]."""
    stem, whole = _SECONDS.sub("", column), stream.columns[column].astype(np.float64)
    for name in stream.columns if stem != column else ():
        size = _RESTS.get(name[len(stem) :].lower(), 0) if name.startswith(stem) else 0
        fraction = stream.columns[name].astype(np.float64) if size else whole
        there = np.isfinite(whole) & np.isfinite(fraction)
        inside = (fraction >= 0.0) & (fraction * size < SECOND) & (whole == np.floor(whole))
        if size and there.any() and inside[there].all() and np.ptp(fraction[there]) > 0.0:
            return name, size
    return None


def _refuse_coarse(stream: Stream, column: str, unit: str | None, today: float) -> None:
    """Refuse a time that stands still on most rows while the others go on: repeated stamps would be dropped."""
    time = stream.columns[column][:_LOOKED_AT_ROWS].astype(np.float64)
    same = np.diff(time) == 0.0
    if len(same) < _RISING_ROWS or same.mean() < _COARSE_SHARE:
        return
    others = [values[:_LOOKED_AT_ROWS].astype(np.float64) for name, values in stream.columns.items() if name != column]
    change = [float((np.abs(np.diff(values)[same]) > 0.0).mean()) for values in others if np.ptp(values) != 0.0]
    if change and np.mean(np.array(change) > 0.5) > 0.5:
        new, rate = np.flatnonzero(~same) + 1, "HZ"
        with suppress(InputError):
            size = float(per_second(unit or _unit(stream, column, time, today)[0]))
            rate = f"{(new[-1] - new[0]) / (time[new[-1]] - time[new[0]]) * size:.4g}" if len(new) > 1 else rate
        raise CoarseTimeError(
            f"{stream.name}: time {cut(column)} has {len(new) + 1} values in {len(time)} rows, in which others change: "
            f"too coarse for the time of rows; give their rate in its place (rate_hz = {rate}), or another column"
        )


def _given(stream: Stream, columns: Sequence[str]) -> str | None:
    """Return the column of this table among those that were given."""
    for reference in columns:
        try:
            places = places_of(reference, [stream])
        except InputError:
            if len(columns) == 1:
                raise
            continue
        if len(places) != 1:
            raise InputError(f'{stream.name}: time "{cut(reference)}": expected one column, got {len(places)}')
        return places[0].column
    return None


def times_among(stream: Stream, references: Sequence[str]) -> list[str]:
    """Return the columns of a table that are given as the time, else those that may hold it."""
    stated = [name for one in references for name in (one, one.partition(":")[2]) if name in stream.columns]
    named = stated or time_columns(stream)
    return [*named, *(fraction[0] for name in named if (fraction := rest_of(stream, name)) is not None)]


def time_columns(stream: Stream) -> list[str]:
    """Return the columns whose names say that they hold the time; the plainest alone where it is clear."""
    named = [name for name in stream.columns if _NAMED.match(name.lstrip("%").strip())]
    rests = [fraction[0] for name in named if (fraction := rest_of(stream, name)) is not None]
    named = [name for name in named if name not in rests]
    if not named:  # t_encoder
        named = [name for name in stream.columns if re.fullmatch(r"(t|time|stamp|timestamp)_\w+", name)]
    if not named and stream.dates:
        return list(stream.dates[:1])
    if not named and is_nameless(stream) and len(stream.columns) > 1 and stream.rows >= _RISING_ROWS:
        numbers = {name: np.asarray(values, dtype=np.float64) for name, values in stream.columns.items()}
        rising = [name for name, values in numbers.items() if (np.diff(values) > 0.0).all()]
        return rising[:1] if rising[:1] == list(numbers)[:1] or len(rising) == 1 else []
    headers = [name for name in named if re.search(r"stamp", name, re.IGNORECASE)]
    plain = [name for name in named if re.fullmatch(r"%?(time|t)([_ ]?[\[(]?\w+[\])]?)?", name, re.IGNORECASE)]
    if len(plain) == 1 and not (plain[0].startswith("%") and headers):
        return plain
    return headers if len(headers) == 1 else named


def is_nameless(stream: Stream) -> bool:
    """Return True if all columns but time are those of one array: a .npy, or a text without names."""
    names = [name for name in stream.columns if not _NAMED.match(name)]
    matches = [re.fullmatch(r"([^\[]+)\[\d+\]", name) for name in names]
    return all(matches) and len({one[1] for one in matches if one}) == 1


def _unit(stream: Stream, column: str, values: NDArray[np.generic], today: float) -> tuple[str, str]:
    if column in stream.dates:
        return "ns", "a date or a time of day"
    match = _NAMED.match(stream.titled(column).lstrip("%").strip())
    named = match and (match["unit"] or re.search(r"sec(?:ond)?s?\Z", match["name"], re.IGNORECASE))
    if match and named:
        return _SPELT[(match["unit"] or "s").lower()], "by its name"
    finite = values[np.isfinite(values.astype(np.float64))].astype(np.float64)
    if len(finite) < 2:
        raise InputError(f"{stream.name}: time {cut(column)}: {len(finite)} finite number(s), expected two at least")
    known = _clocks_of(values, today)
    if len({clock.unit for clock in known}) == 1:
        return known[0].unit, " or ".join(clock.name for clock in known)
    step = _step(finite)
    rates = {unit: float(per_second(unit)) / step if step else 0.0 for unit in UNITS}
    likely = [unit for unit, rate in rates.items() if rate and _LIKELY_STEP_S[0] <= 1.0 / rate <= _LIKELY_STEP_S[1]]
    is_whole = bool((finite == np.floor(finite)).all())
    if len(likely) == 1 and not is_whole:
        return likely[0], f"rows are then {rates[likely[0]]:.4g} Hz"
    choices = ", ".join(f"{unit} ({rate:.4g} Hz)" if step else unit for unit, rate in rates.items())
    raise InputError(
        f"{stream.name}: unit of time {cut(column)} cannot be inferred, rows are {step:g} apart; say it "
        f"(time_unit, or --map time={cut(column)}@UNIT): {choices}, or of a counter its rate, such as 4000Hz"
    )


def _step(values: NDArray[np.float64]) -> float:
    """Return the usual step forward between rows; 0 where there is none."""
    steps = np.diff(values)
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def _clocks_of(values: NDArray[np.generic], today: float, unit: str | None = None) -> tuple[_Clock, ...]:
    """Return the known clocks, those of a unit if it is known, that read 2000 to today all along.

    An unknown unit is proven by a likely step, too: milliseconds since a start 12 days ago are no seconds since 1970.
    """
    numbers = values.astype(np.float64)
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return ()
    low, high = np.quantile(finite, (0.05, 0.95)).tolist()  # a first row may be from before the clock was set
    step, is_whole = _step(finite), bool((finite == np.floor(finite)).all())

    def fits(clock: _Clock) -> bool:
        count = float(per_second(clock.unit))
        longest = _LIKELY_STEP_S[1] if is_whole or clock.unit == "day" else _DAY_S
        is_told = clock.unit == unit or (unit is None and step / count <= longest)
        return is_told and _FIRST_DATE_S <= low / count + clock.zero and high / count + clock.zero <= today + _DAY_S

    return tuple(filter(fits, _CLOCKS))


def _stamps(values: NDArray[np.generic], unit: str, clocks: Sequence[_Clock]) -> tuple[Integers, str]:
    """Return stamps [ns], since 1970 where one clock reads them, and what is said of it; `_LOST_NS` where none is.

    Counted from the first, so that they keep what a float64 has of them.
    """
    count, zero = per_second(unit), clocks[0].zero if len(clocks) == 1 else 0
    with np.errstate(invalid="ignore"):
        lost = ~(np.abs(values.astype(np.float64) / float(count) + zero) < 9e9)
    stamp = np.full(len(values), _LOST_NS)
    if lost.all():
        return stamp, ""
    first = values[~lost][0].item()
    if len(clocks) != 1 and abs(first / count) >= FIRST_DATE_S:
        zero = -(int(first / count) // _UNDATED_S * _UNDATED_S)
    begin, size = round((Fraction(first) / count + zero) * SECOND), SECOND / count
    ahead = values[~lost] - values[~lost][0]
    exact = ahead.dtype.kind == "i" and size.denominator == 1
    stamp[~lost] = begin + (ahead * int(size) if exact else np.rint(ahead * float(size)).astype(np.int64))
    return stamp, clocks[0].name if len(clocks) == 1 else "without a date" * (zero != 0)


def _even(stream: Stream, rate: float, text: str) -> TableTime:
    if not 1e-3 <= rate <= 1e6:
        raise InputError(f"{stream.name}: rate {rate:g}: expected 0.001 to 1,000,000 Hz, rows a second")
    rows = np.arange(stream.rows)
    rows -= np.maximum.accumulate(np.where(np.isin(rows, stream.starts), rows, 0))  # each recording from its first
    return TableTime(np.rint(rows * (SECOND / rate)).astype(np.int64), "", "s", text, rows / rate)
