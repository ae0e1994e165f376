import time

from catenary.simulation.simulated_plant import PacedPlant
from oracles.ideal_plant import IdealPlant


def test_paced_ticks_last_as_long_as_a_robots() -> None:
    plant = PacedPlant(IdealPlant([0.0], period=0.002))
    begin = time.monotonic()
    for _ in range(100):
        plant.wait()
    # no tick is shorter than it should be on the whole; the first one sets the clock
    assert time.monotonic() - begin >= 0.198


def test_a_late_tick_is_counted_and_makes_none_leap() -> None:
    plant = PacedPlant(IdealPlant([0.0], period=0.002))
    plant.wait()
    time.sleep(0.05)
    begin = time.monotonic()
    for _ in range(10):
        plant.wait()
    assert plant.late >= 1
    assert time.monotonic() - begin >= 0.018  # none of them caught up
