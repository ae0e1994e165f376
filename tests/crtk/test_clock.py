import pytest

from catenary.crtk.clock import SECOND, ManualClock, Rate, WallClock
from catenary.errors import InputError


def test_manual_time_passes_only_in_sleep() -> None:
    clock = ManualClock(5 * SECOND)
    assert clock.now() == 5 * SECOND
    clock.sleep(0.25)
    clock.sleep(-1.0)
    assert clock.now() - 5 * SECOND == clock.elapsed() == SECOND // 4


def test_wall_time_grows() -> None:
    clock = WallClock()
    now, elapsed = clock.now(), clock.elapsed()
    clock.sleep(0.002)
    assert clock.elapsed() - elapsed >= 2_000_000
    assert clock.now() > now


def test_a_loop_keeps_its_rate() -> None:
    clock = ManualClock()
    rate = Rate(clock, 1000.0)
    for _ in range(2500):
        rate.sleep()
    assert clock.elapsed() == pytest.approx(2.5 * SECOND, abs=1)
    assert rate.late == 0


def test_a_slow_tick_does_not_shift_those_behind_it() -> None:
    clock = ManualClock()
    rate = Rate(clock, 100.0)
    rate.sleep()
    clock.sleep(0.015)  # half a period late
    rate.sleep()
    rate.sleep()
    assert clock.elapsed() == pytest.approx(0.03 * SECOND, abs=1)
    assert rate.late == 0


def test_missed_ticks_are_counted_and_not_made_up() -> None:
    clock = ManualClock()
    rate = Rate(clock, 100.0)
    clock.sleep(1.0)
    rate.sleep()
    rate.sleep()
    assert clock.elapsed() == pytest.approx(1.01 * SECOND, abs=1)
    assert rate.late == 1


@pytest.mark.parametrize("hertz", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none_is_refused(hertz: float) -> None:
    with pytest.raises(InputError, match="Hz"):
        Rate(ManualClock(), hertz)
