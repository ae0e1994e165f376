"""The time of a table's rows: which column holds it, and in which unit."""

import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Integers
from catenary.documents import cut
from catenary.errors import InputError
from catenary.recording.import_formats.columns import Stream, places_of
from catenary.topics import SECOND

TimeUnit = Literal["s", "ms", "us", "ns"]
UNITS: tuple[str, ...] = get_args(TimeUnit)
PER_UNIT = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}  # [ns]
_NAMED = re.compile(
    r"(?P<name>(?:.*[./_ ])?(?:time|times|t|stamp|timestamp|timestamps|time_?stamp|clock|sec|secs|seconds|zeit))"
    r"(?:[_ ]?[\[(]?(?P<unit>s|sec|ms|msec|us|usec|µs|ns|nsec)[\])]?)?\Z",
    re.IGNORECASE,
)
_WORDS = {"sec": "s", "msec": "ms", "usec": "us", "µs": "us", "nsec": "ns"}
# [s] of a step between rows: 2 kHz to 0.2 Hz, which is how slowly poses are taken one by one
_LIKELY = (0.0005, 5.0)
_EPOCH = (9.5e8, 4.2e9)  # [s] since 1970: the years 2000 to 2100
# single numbers of a file that say how many rows a second has, as labs, cameras and simulators call them
RATES = ("fs", "rate", "rate_hz", "sampling_rate", "sample_rate", "frequency", "fps", "hz", "control_freq")
_RISING = 100  # rows over which no joint moves one way alone
_COARSE = 2 / 3  # share of rows that have the time of the row before, while most columns change
_LOOKED_AT = 10_000  # rows, for that
# what stands at the end of a name of whole seconds, and of one beside it of the rest of each stamp [ns]
_SECONDS = re.compile(r"(?:secs?|seconds|s)\Z", re.IGNORECASE)
_RESTS = {"nsec": 1, "nsecs": 1, "nanosec": 1, "nanosecs": 1, "nanoseconds": 1, "ns": 1, "usec": 1000, "usecs": 1000}


class CoarseTimeError(InputError):
    """Rows were taken faster than their time was written."""


class TableTime(NamedTuple):
    """Stamps of a table's rows."""

    stamp: Integers  # (M,) [ns], as in the file; NaN's rows hold the least number
    column: str | None  # "" where rows are evenly apart; None where they have no time
    unit: str
    said: str  # how it was found, for the reader
    seconds: NDArray[np.float64] | None = None  # (M,) as exact as the file has them, where it has no whole numbers


def time_of(stream: Stream, columns: Sequence[str], unit: str | None, rate: float | None) -> TableTime | None:
    """Return the stamps of a table's rows by `columns`, a name or the rate; None where it has none."""
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
    rest = rest_of(stream, column)
    if rest is not None:
        name, size = rest
        stamp = values.astype(np.int64) * SECOND + stream.columns[name].astype(np.int64) * size
        return TableTime(stamp, column, "s", f"time is {cut(column)} in s and {cut(name)} in {size} ns")
    _refuse_coarse(stream, column, unit)
    told, why = (unit, "as given") if unit is not None else _unit(stream, column, values)
    said = f"time is {cut(column)} in {told} ({why})"
    if values.dtype.kind == "i":
        return TableTime(values.astype(np.int64) * PER_UNIT[told], column, told, said)
    numbers = values.astype(np.float64)
    return TableTime(_nanoseconds(numbers, PER_UNIT[told]), column, told, said, numbers / (SECOND // PER_UNIT[told]))


def rest_of(stream: Stream, column: str) -> tuple[str, int] | None:
    """Return the column of what a time has beyond whole seconds, nsec beside sec as in ROS, and its unit [ns]."""
    stem, whole = _SECONDS.sub("", column), stream.columns[column].astype(np.float64)
    for name in stream.columns if stem != column else ():
        size = _RESTS.get(name[len(stem) :].lower(), 0) if name.startswith(stem) else 0
        rest = stream.columns[name].astype(np.float64) if size else whole
        inside = (rest >= 0.0) & (rest * size < SECOND) & (whole == np.floor(whole))
        if size and inside.all() and np.ptp(rest) > 0.0:
            return name, size
    return None


def _refuse_coarse(stream: Stream, column: str, unit: str | None) -> None:
    """Refuse a time that stands still on most rows while the others go on: repeated stamps would be dropped."""
    time = stream.columns[column][:_LOOKED_AT].astype(np.float64)
    same = np.diff(time) == 0.0
    if len(same) < _RISING or same.mean() < _COARSE:
        return
    others = [values[:_LOOKED_AT].astype(np.float64) for name, values in stream.columns.items() if name != column]
    change = [float((np.abs(np.diff(values)[same]) > 0.0).mean()) for values in others if np.ptp(values) != 0.0]
    if change and np.mean(np.array(change) > 0.5) > 0.5:
        new, rate = np.flatnonzero(~same) + 1, "HZ"
        with suppress(InputError):
            size = PER_UNIT[unit or _unit(stream, column, time)[0]] / SECOND
            rate = f"{(new[-1] - new[0]) / ((time[new[-1]] - time[new[0]]) * size):.4g}" if len(new) > 1 else rate
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
    given = [name for one in references for name in (one, one.partition(":")[2]) if name in stream.columns]
    named = given or time_columns(stream)
    return [*named, *(rest[0] for name in named if (rest := rest_of(stream, name)) is not None)]


def time_columns(stream: Stream) -> list[str]:
    """Return the columns whose names say that they hold the time; the plainest alone where it is clear."""
    named = [name for name in stream.columns if _NAMED.match(name.lstrip("%").strip())]
    if not named:  # t_encoder
        named = [name for name in stream.columns if re.fullmatch(r"(t|time|stamp|timestamp)_\w+", name)]
    if not named and stream.dates:
        return list(stream.dates[:1])
    if not named and is_nameless(stream) and len(stream.columns) > 1 and stream.rows >= _RISING:
        numbers = {name: np.asarray(values, dtype=np.float64) for name, values in stream.columns.items()}
        rising = [name for name, values in numbers.items() if (np.diff(values) > 0.0).all()]
        return rising[:1] if rising[:1] == list(numbers)[:1] or len(rising) == 1 else []
    headers = [name for name in named if re.search(r"stamp", name, re.IGNORECASE)]
    plain = [name for name in named if re.fullmatch(r"%?(time|t)([_ ]?[\[(]?\w+[\])]?)?", name, re.IGNORECASE)]
    if len(plain) == 1 and not (plain[0].startswith("%") and headers):
        return plain
    return headers if len(headers) == 1 else named


def is_nameless(stream: Stream) -> bool:
    """Return whether all columns of a table but the time are those of one array: a .npy, or a text without names."""
    names = [name for name in stream.columns if not _NAMED.match(name)]
    found = [re.fullmatch(r"([^\[]+)\[\d+\]", name) for name in names]
    return all(found) and len({one[1] for one in found if one}) == 1


def _unit(stream: Stream, column: str, values: NDArray[np.generic]) -> tuple[str, str]:
    if column in stream.dates:
        return "ns", "a date or a time of day"
    found = _NAMED.match(column.lstrip("%").strip())
    if found and found["unit"]:
        unit = found["unit"].lower()
        return _WORDS.get(unit, unit), "by its name"
    finite = values[np.isfinite(values.astype(np.float64))].astype(np.float64)
    if len(finite) < 2:
        raise InputError(f"{stream.name}: time {cut(column)}: {len(finite)} finite number(s), expected two at least")
    since = [u for u in UNITS if _EPOCH[0] <= abs(finite[0]) * PER_UNIT[u] / SECOND <= _EPOCH[1]]
    if since:
        return since[0], "a time since 1970"
    steps = np.diff(finite)
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    likely = [u for u in UNITS if _LIKELY[0] <= step * PER_UNIT[u] / SECOND <= _LIKELY[1]]
    if len(likely) == 1:
        rate = SECOND / (step * PER_UNIT[likely[0]])
        return likely[0], f"rows are then {rate:.4g} Hz"
    choices = ", ".join(f"{u} ({SECOND / (step * PER_UNIT[u]):.4g} Hz)" for u in UNITS) if step else "s, ms, us, ns"
    raise InputError(
        f"{stream.name}: unit of time {cut(column)} cannot be told, rows are {step:g} apart; say it "
        f"(time_unit, or --map time={cut(column)}@UNIT): {choices}"
    )


def _nanoseconds(values: NDArray[np.float64], unit: int) -> Integers:
    """Return stamps [ns]; counted from the first, so that seconds since 1970 keep what a float64 has of them."""
    with np.errstate(invalid="ignore"):
        lost = ~(np.abs(values) < 9e18 / unit)
    stamp = np.full(len(values), np.iinfo(np.int64).min)
    if not lost.all():
        first = float(values[~lost][0])
        whole = int(first // 1.0)
        start = whole * unit + round((first - whole) * unit)
        stamp[~lost] = start + np.rint((values[~lost] - first) * unit).astype(np.int64)
    return stamp


def _even(stream: Stream, rate: float, said: str) -> TableTime:
    if not 1e-3 <= rate <= 1e6:
        raise InputError(f"{stream.name}: rate {rate:g}: expected 0.001 to 1,000,000 Hz, rows a second")
    rows = np.arange(stream.rows)
    rows -= np.maximum.accumulate(np.where(np.isin(rows, stream.starts), rows, 0))  # each recording from its first
    return TableTime(np.rint(rows * (SECOND / rate)).astype(np.int64), "", "s", said, rows / rate)
