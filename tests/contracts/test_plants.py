"""What every plant keeps to, real or simulated; a new one joins PLANTS."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.client import CrtkClient
from catenary.errors import CatenaryError, InputError, NotReadyError, UnsupportedCommandError
from catenary.open_robot import KINDS, Simulated, open_robot
from catenary.plant import Plant, fault_of
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.cable_plant import CablePlant, PositioningArm
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.simulation.psm_plant import PsmPlant
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import RobotOnLoopback
from oracles.psm_arms import homed_psm


def behind_topics(plant: Plant, dialect: str, arm: str) -> CrtkClient:
    """A plant over messages."""
    setup = RobotOnLoopback(plant, dialect=dialect, arm=arm)
    return CrtkClient(setup.transport, dialect=dialect, arm=arm)


ROCKING = RockingBase(mean=0.2, amplitude=0.3, frequency=0.7, lever=(0.1, 0.2, 0.5))
GENTLE = RockingBase(mean=0.2, amplitude=0.1, frequency=0.3, lever=(0.1, 0.2, 0.5))


def homed_mujoco(robot: str, base: RockingBase | None = None) -> MujocoPlant:
    plant = MujocoPlant(load_robot(robot), base=base)
    plant.home()
    return plant


def unhomed_mujoco(robot: str) -> MujocoPlant:
    return unhomed(MujocoPlant(load_robot(robot)))


def unhomed(plant: Any) -> Any:
    plant.state_command("enable")
    plant.state_command("unhome")
    return plant


PLANTS = {
    "psm": (homed_psm, PsmPlant),
    **{
        robot: (
            lambda robot=robot: open_robot(robot, Simulated()),
            lambda robot=robot: unhomed(open_robot(robot, Simulated(homed=False))),
        )
        for robot in ("dvrk_mtm", "dvrk_ecm")
    },
    "cable left": (lambda: homed_plant("left"), lambda: CablePlant(side="left")),
    "cable right": (lambda: homed_plant("right"), lambda: CablePlant(side="right")),
    "mujoco raven2": (lambda: homed_mujoco("raven2"), lambda: MujocoPlant(load_robot("raven2"))),
    "mujoco planar": (lambda: homed_mujoco("planar_3r", GENTLE), lambda: unhomed_mujoco("planar_3r")),
    "positioning joints": (lambda: PositioningArm(homed_plant("left")), lambda: PositioningArm(CablePlant())),
    "client, raven": (
        lambda: behind_topics(homed_plant("left"), "raven", "gold"),
        lambda: behind_topics(CablePlant(side="left"), "raven", "gold"),
    ),
    "client, crtk": (
        lambda: behind_topics(homed_plant("right"), "crtk", "green"),
        lambda: behind_topics(CablePlant(side="right"), "crtk", "green"),
    ),
}
UNITS = ("rad", "m")
SERVO = ("servo_jp", "servo_jr", "servo_jf")


@pytest.mark.parametrize("robot", [*KINDS, "planar_3r"])
def test_every_kind_of_simulated_robot_is_among_these(robot: str) -> None:
    opened = open_robot(robot, Simulated(homed=False))
    assert (type(opened), opened.joint_names) in [
        (type(one), one.joint_names) for one in (fresh() for _, fresh in PLANTS.values())
    ]


@pytest.fixture(params=PLANTS)
def ready(request) -> Plant:
    """Homed and enabled."""
    return PLANTS[request.param][0]()


@pytest.fixture(params=PLANTS)
def fresh(request) -> Plant:
    """As it wakes up."""
    return PLANTS[request.param][1]()


def test_plant_has_words_for_why_it_is_in_fault(ready: Plant) -> None:
    assert hasattr(ready, "fault_reason")  # by which `fault_of` asks
    assert fault_of(ready) == ""


def still(plant: Plant, verb: str) -> np.ndarray:
    """A command of that verb which asks for no motion."""
    return plant.setpoint_js().q if verb == "servo_jp" else np.zeros(len(plant.joint_names))


def test_names_units_and_limits_have_one_entry_a_joint(ready):
    n = len(ready.joint_names)
    assert len(set(ready.joint_names)) == n
    assert len(ready.joint_units) == n
    assert set(ready.joint_units) <= set(UNITS)
    assert ready.lower.shape == ready.upper.shape == (n,)
    assert (ready.lower < ready.upper).all()


@pytest.mark.parametrize("verb", ["measured_js", "setpoint_js"])
def test_joint_states_are_finite_and_of_the_right_shape(ready, verb):
    state = getattr(ready, verb)()
    n = len(ready.joint_names)
    for values in (state.q, state.qd, state.tau):
        assert values.shape == (n,)
        assert np.isfinite(values).all()
    assert state.q_motor.ndim == 1
    assert np.isfinite(state.q_motor).all()
    assert 9.0 < np.linalg.norm(state.gravity) < 10.6
    assert state.gravity_age >= 0.0


@pytest.mark.parametrize(
    "arrays",
    [
        lambda plant: plant.measured_js()[1:4],
        lambda plant: [plant.measured_js().gravity, plant.lower, plant.upper],
        lambda plant: list(plant.telemetry().values()),
    ],
    ids=["joint states", "gravity and limits", "telemetry"],
)
def test_arrays_are_the_receivers_own(ready, arrays):
    for values in arrays(ready):
        values[:] = -12_345.0
    assert all((values != -12_345.0).all() for values in arrays(ready))


@pytest.mark.parametrize(
    "make",
    [lambda: CablePlant(base=ROCKING), lambda: PsmPlant(base=ROCKING), lambda: homed_mujoco("two_link", ROCKING)],
)
def test_joint_state_holds_what_an_inertial_unit_on_a_moving_base_reads(make):
    plant = make()
    for _ in range(200):
        plant.wait()
    state, seen = plant.measured_js(), plant.telemetry()
    assert_allclose(state.gravity, -seen["accelerometer"], atol=1e-12)
    assert_allclose(state.base_rates[0], seen["gyroscope"], atol=1e-12)
    # the gyroscope's slope over two ticks
    before = plant.telemetry()["gyroscope"]
    plant.wait()
    middle = plant.measured_js().base_rates[1]
    plant.wait()
    slope = (plant.telemetry()["gyroscope"] - before) / (2.0 * plant.period)
    assert_allclose(middle, slope, atol=1e-4)  # central difference of a sine of 4.4 rad/s, h = 1 ms


def test_waiting_advances_time_by_the_period(ready):
    start = ready.measured_js().time
    for _ in range(10):
        ready.wait()
    assert_allclose(ready.measured_js().time - start, 10 * ready.period, rtol=1e-9)


def test_telemetry_has_the_declared_columns(ready):
    sample = ready.telemetry()
    assert list(sample) == [column.name for column in ready.columns]
    for column in ready.columns:
        assert column.unit
        assert sample[column.name].shape == (column.width,)
        assert np.isfinite(sample[column.name]).all()


@pytest.mark.parametrize("verb", SERVO)
def test_supported_verbs_are_obeyed_and_others_refused(ready, verb):
    command = still(ready, verb)
    if verb in ready.supports:
        getattr(ready, verb)(command)
        ready.wait()
    else:
        with pytest.raises(UnsupportedCommandError):
            getattr(ready, verb)(command)


@pytest.mark.parametrize("verb", SERVO)
def test_plant_that_is_not_homed_is_not_moved(fresh, verb):
    with pytest.raises((NotReadyError, UnsupportedCommandError)):
        getattr(fresh, verb)(np.zeros(len(fresh.joint_names)))


@pytest.mark.parametrize("verb", SERVO)
def test_disabled_plant_is_not_moved(ready, verb):
    command = still(ready, verb)
    ready.state_command("disable")
    with pytest.raises((NotReadyError, UnsupportedCommandError)):
        getattr(ready, verb)(command)


@pytest.mark.parametrize("verb", SERVO)
@pytest.mark.parametrize("fault", ["short", "long", "nan", "text"])
def test_bad_commands_are_refused(ready, verb, fault):
    n = len(ready.joint_names)
    bad = {"short": np.zeros(n - 1), "long": np.zeros(n + 1), "nan": np.full(n, np.nan), "text": ["a"] * n}[fault]
    with pytest.raises((InputError, UnsupportedCommandError)):
        getattr(ready, verb)(bad)


def test_a_refused_command_changes_nothing(ready):
    before = ready.setpoint_js().q
    with pytest.raises(CatenaryError):
        ready.servo_jp(np.full(len(ready.joint_names), np.nan))
    ready.wait()
    assert_allclose(ready.setpoint_js().q, before, atol=1e-15)


@pytest.mark.parametrize("verb", ["servo_jp", "servo_jr"])
def test_setpoint_follows_a_command(ready, verb):
    wanted = ready.setpoint_js().q + 1e-5
    getattr(ready, verb)(wanted if verb == "servo_jp" else np.full(len(wanted), 1e-5))
    ready.wait()
    assert_allclose(ready.setpoint_js().q, wanted, atol=1e-12)


def test_setpoint_stays_within_the_limits(ready):
    for _ in range(400):
        ready.servo_jr(np.full(len(ready.joint_names), 1e-4))
        ready.wait()
    assert (ready.setpoint_js().q <= ready.upper).all()


def test_states_are_those_of_crtk(ready):
    for command, state in (("disable", "DISABLED"), ("enable", "ENABLED"), ("pause", "PAUSED"), ("resume", "ENABLED")):
        ready.state_command(command)
        assert ready.operating_state().state == state


def test_unknown_state_command_is_refused(ready):
    with pytest.raises(UnsupportedCommandError):
        ready.state_command("nonsense")


def test_no_torque_takes_a_simulated_robot_beyond_its_models_limits():
    plant = homed_mujoco("raven2")
    for sign in (1.0, -1.0):
        for _ in range(300):
            plant.servo_jf(sign * np.full(len(plant.joint_names), 50.0))
            plant.wait()
            q = plant.measured_js().q
            assert ((plant.lower <= q) & (q <= plant.upper)).all()
