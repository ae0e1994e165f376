import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.sensing.gravity_vector import ReadingStatus
from catenary.simulation.base_motion import _CHANGE_TIME_S, SteeredBase
from catenary.view.simulated_arm import _SENSOR_FAULTS, Surroundings
from catenary.workflows.gravity_trials import simulated_arm


@pytest.fixture(scope="module")
def world() -> Surroundings:
    return Surroundings(simulated_arm("raven2", base=SteeredBase()))


def run(world: Surroundings, seconds: float) -> None:
    for _ in range(round(seconds / world.plant.period)):
        world.plant.wait()
        world.read(world.plant.time)


def test_sensor_follows_the_base_that_is_tilted(world: Surroundings) -> None:
    world.changes()["roll_deg"](40.0)
    run(world, _CHANGE_TIME_S + 0.5)
    roll = np.deg2rad(40.0)
    assert_allclose(world.actual(), 9.81 * np.array([0.0, -np.sin(roll), -np.cos(roll)]), atol=1e-9)
    assert world.reading is not None
    assert_allclose(world.reading.gravity, world.actual(), atol=0.1)  # noise of a cheap sensor
    assert world.warnings() == ()
    world.changes()["roll_deg"](0.0)
    run(world, _CHANGE_TIME_S + 0.5)


@pytest.mark.parametrize(
    ("fault", "message"), [("unplugged", "samples stopped coming"), ("stuck", "repeats one reading")]
)
def test_broken_sensor_is_told_in_words_and_mends(world: Surroundings, fault: str, message: str) -> None:
    world.changes()["sensor"](fault)
    run(world, 0.6)
    assert message in " ".join(world.warnings())
    world.changes()["sensor"]("none")
    run(world, 1.5)
    assert world.warnings() == ()
    assert world.reading is not None
    assert world.reading.status is ReadingStatus.LIVE


def test_every_fault_on_the_page_can_be_set(world: Surroundings) -> None:
    for fault in _SENSOR_FAULTS:
        world.changes()["sensor"](fault)
    world.changes()["sensor"]("none")


@pytest.mark.parametrize(("name", "value"), [("payload_kg", 0.5), ("friction", 2.0), ("wear", 0.5)])
def test_cables_and_payload_change_what_the_arm_does(world: Surroundings, name: str, value: float) -> None:
    plant = world.plant
    before = plant.state.q.copy()
    world.changes()[name](value)
    run(world, 0.3)
    changed = np.abs(plant.state.q - before).max()
    world.changes()[name](1.0 if name == "friction" else 0.0)
    run(world, 0.3)
    # friction alone lets an arm at rest rest
    assert changed > 1e-5 or name == "friction"
