import pytest

from catenary.crtk.transport import Clock, Rate
from catenary.errors import InputError
from catenary.topics import SECOND
from oracles.ticking_clock import SetClock


@pytest.mark.parametrize(
    ("delays", "ends", "late"),
    [
        ([0.0] * 250, 2.5, 0),
        ([0.0, 0.015, 0.0], 0.03, 0),  # half a period late: those behind it are on their grid
        ([1.0, 0.0], 1.01, 1),  # missed ticks are counted and not made up for
    ],
)
def test_a_loop_keeps_its_rate(delays: list[float], ends: float, late: int) -> None:
    clock = SetClock()
    rate = Rate(clock, 100.0)
    for delay in delays:
        clock.sleep(delay)
        rate.sleep()
    assert clock.elapsed() == pytest.approx(ends * SECOND, abs=1)
    assert rate.late == late


class Interrupted(Clock):
    """A clock whose program stands still for three seconds between two readings, once."""

    def __init__(self) -> None:
        self.readings = iter([0, 3 * SECOND, *[3 * SECOND + 1000] * 100])
        super().__init__()

    def now(self) -> int:
        return 5 * SECOND

    def elapsed(self) -> int:
        return next(self.readings)


def test_a_program_that_stands_still_between_two_readings_does_not_take_the_clock_for_set() -> None:
    clock = Interrupted()
    assert clock.set_by() == 0
    assert clock.steady() == 5 * SECOND


@pytest.mark.parametrize("hertz", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none_is_refused(hertz: float) -> None:
    with pytest.raises(InputError, match="Hz"):
        Rate(SetClock(), hertz)
