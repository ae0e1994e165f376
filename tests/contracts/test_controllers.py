"""What every controller must do."""

import os
import subprocess
import sys
from collections.abc import Callable
from copy import deepcopy
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import pytest

import catenary
from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.control.controllers import CONTROLLERS, HOLDS
from catenary.control.elastic_pd import ElasticPD
from catenary.control.gains import JointGains
from catenary.control.hand_guiding import HandGuiding
from catenary.control.loop import run_loop
from catenary.control.pd import EstimatedGravityPD, GravityHold, JointPD, SplitController
from catenary.errors import InputError
from catenary.gravity.estimator import GravityEstimator, RecursiveGravityEstimator
from catenary.plant import AT_REST, JointState
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.trajectories.reference import Reference, Rest
from catenary.workflows.gravity_trials import simulated_arm
from compilations import compilations

N = 3
KP, KD = np.array([90.0, 50.0, 400.0]), np.array([2.0, 1.0, 8.0])
ARM = load_robot("raven2")
SPRINGS = np.array([260.0, 500.0, 7e4])


def with_estimated_gravity(recursive: bool) -> SplitController:
    learner = RecursiveGravityEstimator(ARM, noise=0.1) if recursive else GravityEstimator(ARM, KP, KD)
    return EstimatedGravityPD(KP, KD, learner)


class Arm(NamedTuple):
    """An arm that has all that a controller may need."""

    model: RobotModel = ARM
    gains: JointGains = JointGains(KP, KD)
    motor_inertia: Floats | None = np.eye(3)
    stiffness: Floats | None = SPRINGS


MADE: dict[str, Callable[[], SplitController]] = {
    **{name: partial(kind.make, Arm()) for name, kind in CONTROLLERS.items()},
    **{f"{name} alone": partial(kind.make, Arm()) for name, kind in HOLDS.items()},
    "pd, absolute damping": lambda: JointPD(KP, KD, damping="absolute"),
    "hand guiding": lambda: HandGuiding(ARM, KP, KD, deviation=0.5, max_payload=1.0),
    "pd with estimated gravity": lambda: with_estimated_gravity(False),
    "pd with gravity from recursive least squares": lambda: with_estimated_gravity(True),
}
SENSING = [
    *(name for name, kind in CONTROLLERS.items() if kind.gravity == "sensed"),
    *(f"{name} alone" for name, kind in HOLDS.items() if kind.gravity == "sensed"),
]
TURNING = np.array([[0.1, -0.2, 0.3], [1.0, 2.0, -0.5]])  # of the base [rad/s, rad/s2]


@cache
def made(name: str) -> SplitController:
    return MADE[name]()


@pytest.fixture(params=MADE)
def controller(request: pytest.FixtureRequest) -> SplitController:
    return deepcopy(made(request.param))


def state(values: Floats) -> JointState:
    gravity = np.array([0.0, 1.0, -9.7])
    return JointState(0.0, values, 0.1 * values, 0.0 * values, np.zeros(0), gravity, 0.0, TURNING.copy())


def reference(values: Floats) -> Reference:
    return Reference(values, 0.2 * values, 0.3 * values)


def tick() -> tuple[JointState, Reference]:
    return state(np.array([0.1, 0.2, 0.3])), reference(np.array([0.2, 0.1, 0.3]))


def test_torque_is_finite_one_per_joint_and_the_sum_of_its_parts(controller: SplitController) -> None:
    tau = controller.torque(*tick())
    assert (tau.shape, tau.dtype) == ((N,), np.float64)
    assert np.isfinite(tau).all()
    np.testing.assert_allclose(tau, controller.feedback + controller.feedforward, rtol=1e-15)


def test_arguments_are_left_as_they_are(controller: SplitController) -> None:
    measured, wanted = tick()
    before = [np.array(values) for values in (*measured, *wanted)]
    controller.torque(measured, wanted)
    for old, new in zip(before, (*measured, *wanted), strict=True):
        np.testing.assert_array_equal(old, new)


def test_every_torque_is_an_array_of_its_own(controller: SplitController) -> None:
    measured, wanted = tick()
    first = controller.torque(measured, wanted)
    kept = first.copy()
    second = controller.torque(state(np.zeros(N)), wanted)
    assert not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, kept)


def test_a_copy_computes_apart(controller: SplitController) -> None:
    measured, wanted = tick()
    at_rest, twin = measured._replace(base_rates=AT_REST), deepcopy(controller)  # a constant that all share
    tau = controller.torque(at_rest, wanted)
    parts = controller.feedback.copy(), controller.feedforward.copy()
    twin.torque(at_rest._replace(q=np.zeros(N)), wanted)
    np.testing.assert_array_equal((controller.feedback, controller.feedforward), parts)
    np.testing.assert_array_equal(deepcopy(controller).torque(at_rest, wanted), controller.torque(at_rest, wanted))
    assert np.isfinite(tau).all()


def test_unmeasured_joint_gives_nan_for_itself_and_no_exception(controller: SplitController) -> None:
    tau = controller.torque(state(np.array([0.1, np.nan, 0.3])), tick()[1])
    assert np.isnan(tau[1])


def read_only(values: Floats) -> Floats:
    values.setflags(write=False)
    return values


@pytest.mark.parametrize("change", [read_only, lambda values: np.repeat(values, 2, axis=0)[::2]])
def test_arrays_of_any_layout_and_read_only_ones_are_taken(controller: SplitController, change: Any) -> None:
    measured, wanted = tick()
    expected = deepcopy(controller).torque(measured, wanted)
    q, gravity, rates = (change(values.copy()) for values in (measured.q, measured.gravity, measured.base_rates))
    changed = measured._replace(q=q, gravity=gravity, base_rates=rates)
    np.testing.assert_array_equal(
        controller.torque(changed, Reference(*(change(np.array(values)) for values in wanted))), expected
    )


@pytest.mark.parametrize("controller", SENSING, indirect=True)
def test_a_base_whose_turning_is_not_known_gives_no_torque(controller: SplitController) -> None:
    measured, wanted = tick()
    measured.base_rates[0, 1] = np.nan
    assert np.isnan(controller.torque(measured, wanted)).any()


def test_robot_of_another_size_is_refused(controller: SplitController) -> None:
    with pytest.raises(InputError, match="joints"):
        controller.torque(state(np.zeros(N + 1)), reference(np.zeros(N + 1)))


def test_no_error_asks_for_no_feedback(controller: SplitController) -> None:
    q = np.array([0.3, 1.4, 0.4])
    measured = state(q)._replace(qd=np.zeros(N))
    # elastic joints: the motors stand beyond the links by what gravity winds up
    wind_up = np.zeros(N)
    if isinstance(controller, ElasticPD):
        hold = GravityHold(ARM).torque(measured, Reference(q, np.zeros(N), np.zeros(N)))
        wind_up = hold / SPRINGS
    controller.torque(measured._replace(q=q + wind_up), Reference(q, np.zeros(N), np.zeros(N)))
    np.testing.assert_allclose(controller.feedback, 0.0, atol=1e-11)  # 7e4 N/m times rounding


@pytest.mark.parametrize("robot", ["raven2", "two_link"])
def test_nothing_is_compiled_between_the_first_and_the_last_tick(robot: str) -> None:
    """In a process that has compiled nothing: a tick that compiles leaves the last torque on for .2 s."""
    program = f"from contracts.test_controllers import ticks_of; found = ticks_of({robot!r}); assert not found, found"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment, timeout=300)


def ticks_of(robot: str) -> dict[str, list[str]]:
    """What is compiled while each controller that fits a simulated arm moves it by calibrated positions."""
    arm, found = simulated_arm(robot), {}
    names, units = arm.plant.joint_names, arm.plant.joint_units
    q = np.cumsum(np.random.default_rng(1).normal(size=(400, len(names))), axis=0) * 0.02
    trained = catenary.fit(q, 1.01 * q, units=units, joint_names=names, model="linear", inputs=["q"])
    kinds = [*CONTROLLERS.values(), *HOLDS.values()]
    for kind in (one for one in kinds if one.fits(arm)):
        controller, at = kind.make(arm), Rest(arm.plant.measured_js().q, 0.05)
        with compilations(in_ticks=True) as compiled:
            run_loop(arm.plant, controller, at, limits=arm.limits(), corrector=Corrector(trained), max_speed=np.inf)
        found |= {kind.made_by: compiled} if compiled else {}
    return found
