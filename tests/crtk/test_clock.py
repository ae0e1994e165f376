import pytest

from catenary.crtk.clock import SECOND, Clock, ManualClock, Rate
from catenary.errors import InputError


def test_manual_time_passes_only_in_sleep() -> None:
    clock = ManualClock(5 * SECOND)
    assert clock.now() == 5 * SECOND
    clock.sleep(0.25)
    clock.sleep(-1.0)
    assert clock.now() - 5 * SECOND == clock.elapsed() == SECOND // 4


def test_wall_time_grows() -> None:
    clock = Clock()
    now, elapsed = clock.now(), clock.elapsed()
    clock.sleep(0.002)
    assert clock.elapsed() - elapsed >= 2_000_000
    assert clock.now() > now


@pytest.mark.parametrize(
    ("delays", "ends", "late"),
    [
        ([0.0] * 250, 2.5, 0),
        ([0.0, 0.015, 0.0], 0.03, 0),  # half a period late: those behind it are on their grid
        ([1.0, 0.0], 1.01, 1),  # missed ticks are counted and not made up for
    ],
)
def test_a_loop_keeps_its_rate(delays: list[float], ends: float, late: int) -> None:
    clock = ManualClock()
    rate = Rate(clock, 100.0)
    for delay in delays:
        clock.sleep(delay)
        rate.sleep()
    assert clock.elapsed() == pytest.approx(ends * SECOND, abs=1)
    assert rate.late == late


@pytest.mark.parametrize("hertz", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none_is_refused(hertz: float) -> None:
    with pytest.raises(InputError, match="Hz"):
        Rate(ManualClock(), hertz)
