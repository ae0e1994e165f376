"""Clocks of tables: those of computers are known by what they read, in every container; what may be anything is asked."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import ConfigError, InputError
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.table_time import time_of
from catenary.workflows.import_recording import import_recording, propose_mapping
from lab_bags import true_q
from lab_tables import TABLES, as_csv

NOW = 1_780_000_000.0  # [s since 1970] 28 May 2026, which is today here
ROWS = 400
T = np.cumsum(np.random.default_rng(2).integers(9_000_000, 11_000_000, ROWS)) / 1e9  # [s] about 100 Hz, whole ns
Q = true_q(T)
# counts a second and the zero [s since 1970], by the calendar: as their makers document them
CLOCKS = {
    "Unix s": (Fraction(1), "1970-01-01"),
    "Unix ms": (Fraction(1000), "1970-01-01"),
    "Unix us": (Fraction(10**6), "1970-01-01"),
    "Unix ns": (Fraction(10**9), "1970-01-01"),
    "FILETIME": (Fraction(10**7), "1601-01-01"),
    ".NET ticks": (Fraction(10**7), "0001-01-01"),
    "NTP": (Fraction(1), "1900-01-01"),
    "NTP, 64 bits": (Fraction(2**32), "1900-01-01"),
    "Excel": (Fraction(1, 86_400), "1899-12-30"),
    "datenum": (Fraction(1, 86_400), "-001-12-31"),  # 1 is the first of January of year 0
}
UNKNOWN = {"4 kHz": "4000Hz", "0.1 ms": "10000Hz", "ms": "ms", "us": "us", "ns": "ns"}
RATES = {"4 kHz": 4000, "0.1 ms": 10_000, "ms": 1000, "us": 10**6, "ns": 10**9}


def zero(day: str) -> int:
    return int(np.datetime64(day, "D").astype(np.int64)) * 86_400


def counted(rate: Fraction, since: float, of: str) -> np.ndarray:
    """What a clock reads at `T` after `since`; whole numbers where it counts faster than rows come."""
    exact = [(Fraction(float(t)) + Fraction(since) - zero(of)) * rate for t in T]
    whole = rate >= 1000 and max(exact) < 2**63
    return np.array([round(x) for x in exact], dtype=np.int64) if whole else np.array([float(x) for x in exact])


def table(stamp: np.ndarray, **more: np.ndarray) -> dict[str, np.ndarray]:
    return {"time": stamp, **more, "q1": Q[:, 0], "q2": Q[:, 1]}


@pytest.mark.parametrize("container", TABLES)
@pytest.mark.parametrize("clock", CLOCKS)
def test_a_known_clock_is_read_in_true_seconds_and_by_its_date_in_every_container(
    clock: str, container: str, tmp_path: Path
) -> None:
    rate, of = CLOCKS[clock]
    stamp = counted(rate, NOW - 1e7, of)
    log = import_recording(TABLES[container](tmp_path / "lab", table(stamp)), ["q_nominal=q1,q2"], units="rad")
    least = float(np.spacing(np.abs(stamp.astype(float)).max()) if stamp.dtype.kind == "f" else 1) / float(rate)
    assert_allclose(log.time, T - T[0], atol=2 * least + 1e-9)
    assert log.began == pytest.approx(NOW - 1e7 + T[0], abs=2 * least + 1e-6)


@pytest.mark.parametrize("container", TABLES)
@pytest.mark.parametrize("unit", UNKNOWN)
def test_whole_numbers_of_no_known_clock_are_asked_in_every_container_and_read_as_answered(
    unit: str, container: str, tmp_path: Path
) -> None:
    path = TABLES[container](tmp_path / "lab", table(np.rint(T * RATES[unit])))
    (question,) = [each for each in propose_mapping(path, units="rad").questions if "unit of time" in each]
    assert "--answer time_unit=ms" in question
    with pytest.raises(InputError, match="unit of time time cannot be inferred"):
        import_recording(path, ["q_nominal=q1,q2"], units="rad")
    answered = propose_mapping(path, units="rad", answers={"time_unit": UNKNOWN[unit]})
    assert f'time_unit = "{UNKNOWN[unit]}"' in answered.toml
    log = import_recording(path, ["q_nominal=q1,q2", f"time=time@{UNKNOWN[unit]}"], units="rad")
    assert_allclose(log.time, T - T[0], atol=1.01 / RATES[unit])


@pytest.mark.parametrize("container", TABLES)
@pytest.mark.parametrize(
    ("whole", "rest", "size"),
    [
        ("sec", "msec", 1e-3), ("secs", "nsecs", 1e-9), ("stamp.sec", "stamp.nanosec", 1e-9), ("sec", "usec", 1e-6),
        ("seconds", "milliseconds", 1e-3),
    ],
)  # fmt: skip
def test_seconds_and_what_is_beyond_them_are_one_time(
    whole: str, rest: str, size: float, container: str, tmp_path: Path
) -> None:
    if container == "MATLAB" and "." in whole:
        pytest.skip("no name of a variable of MATLAB's")
    counts = np.rint((T + 0.25) / size).astype(np.int64)
    each = round(1 / size)
    columns = {whole: 1_700_000_000 + counts // each, rest: counts % each, "q1": Q[:, 0], "q2": Q[:, 1]}
    log = import_recording(TABLES[container](tmp_path / "lab", columns), ["q_nominal=q1,q2"], units="rad")
    assert_allclose(log.time, (counts - counts[0]) * size, atol=1e-9)
    assert log.began == pytest.approx(1.7e9 + counts[0] * size, abs=1e-6)


@given(st.sampled_from(sorted(CLOCKS)), st.floats(9.5e8, NOW), st.floats(1e-3, 4.0))
@settings(max_examples=200, deadline=None)
def test_of_any_date_and_rate_a_known_clock_is_read_in_true_seconds(clock: str, since: float, step: float) -> None:
    rate, of = CLOCKS[clock]
    true = [Fraction(since) + k * Fraction(step) for k in range(50)]
    exact = [(t - zero(of)) * rate for t in true]
    whole = rate >= 1000 and max(exact) < 2**63
    stamp = np.array([round(x) for x in exact]) if whole else np.array([float(x) for x in exact])
    found = time_of(Stream("lab", "table", {"t": stamp}, 50), (), None, None, today=NOW)
    least = float(np.spacing(np.abs(stamp.astype(float)).max()) if not whole else 1) / float(rate)
    assert found is not None
    assert_allclose((found.stamp - found.stamp[0]) / 1e9, [float(t - true[0]) for t in true], atol=2 * least + 2e-9)


def read(stamp: np.ndarray, today: float = NOW, name: str = "t") -> tuple[float, np.ndarray]:
    found = time_of(Stream("lab", "table", {name: stamp}, len(stamp)), (), None, None, today=today)
    assert found is not None
    return found.stamp[0] / 1e9, (found.stamp - found.stamp[0]) / 1e9


@pytest.mark.parametrize("of", ["1904-01-01", "1900-01-01"])
def test_seconds_of_labview_or_ntp_have_a_date_only_where_one_of_the_two_may_have_read_them(of: str) -> None:
    """The two differ by four years: what the one reads today, the other read in 2022."""
    began, seconds = read(counted(Fraction(1), 1.5e9, of))
    assert_allclose(seconds, T - T[0], atol=2e-6)
    assert began < 1e9  # no date
    early_or_late = 9.6e8 if of == "1904-01-01" else NOW
    assert read(counted(Fraction(1), early_or_late, of))[0] == pytest.approx(early_or_late + T[0], abs=1e-5)


@pytest.mark.parametrize(("since", "rate"), [(12 * 86_400, 1000), (20 * 60, 10**6), (1.0, 10**9), (5 * 3600, 1)])
def test_a_time_since_a_start_is_no_date(since: float, rate: int) -> None:
    """Of 12 days in ms, 20 minutes in us and 1 s in ns each number is one of seconds since 1970."""
    stamp = np.rint((T + since) * rate) if rate > 1 else T + since
    if rate > 1:
        with pytest.raises(InputError, match="cannot be inferred"):
            read(stamp)
    else:
        assert read(stamp)[0] == pytest.approx(since + T[0])


def test_nothing_was_recorded_after_today() -> None:
    stamp = 1_700_000_000.0 + T
    assert read(stamp, today=1.7e9 + 10)[0] == pytest.approx(1.7e9 + T[0])
    assert read(stamp, today=1.6e9)[0] < 1e9  # the seconds of no known clock


@pytest.mark.parametrize(
    ("name", "unit"),
    [("time [seconds]", 1), ("seconds", 1), ("t_milliseconds", 1000), ("time [µs]", 10**6), ("time (nanosec)", 10**9)],
)
def test_a_name_tells_the_unit_of_whole_numbers(name: str, unit: int) -> None:
    assert_allclose(read(np.rint(1000 * T) * unit, name=name)[1], np.rint(1000 * T) - round(1000 * T[0]), atol=1e-9)


@pytest.mark.parametrize("name", ["times", "ts"])
def test_a_plural_is_no_unit(name: str) -> None:
    with pytest.raises(InputError, match="cannot be inferred"):
        read(np.rint(1000 * T), name=name)


def test_a_unit_that_is_none_is_refused_with_the_choices(tmp_path: Path) -> None:
    path = as_csv(tmp_path / "lab", table(np.rint(1000 * T)))
    with pytest.raises(ConfigError, match=r"time unit fortnight: expected s, ms, us, ns, 100ns.*4000Hz"):
        import_recording(path, ["q_nominal=q1,q2", "time=time@fortnight"], units="rad")
