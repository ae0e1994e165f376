"""What every controller must do."""

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.control.controller import Controller
from catenary.control.estimated_gravity_pd import EstimatedGravityPD
from catenary.control.pd import JointPD
from catenary.errors import InputError
from catenary.gravity.estimator import GravityEstimator
from catenary.gravity.recursive_estimator import RecursiveGravityEstimator
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference

N = 3
KP, KD = np.array([90.0, 50.0, 400.0]), np.array([2.0, 1.0, 8.0])


def with_estimated_gravity(recursive: bool) -> Controller:
    arm = load_robot("raven2")
    learner = RecursiveGravityEstimator(arm, noise=0.1) if recursive else GravityEstimator(arm, KP, KD)
    return EstimatedGravityPD(KP, KD, learner)


CONTROLLERS = {
    "pd": lambda: JointPD(KP, KD),
    "pd with estimated gravity": lambda: with_estimated_gravity(False),
    "pd with gravity from recursive least squares": lambda: with_estimated_gravity(True),
}


@pytest.fixture(params=CONTROLLERS)
def controller(request: pytest.FixtureRequest) -> Controller:
    return CONTROLLERS[request.param]()


def state(values: Floats) -> JointState:
    return JointState(0.0, values, 0.1 * values, 0.0 * values, np.zeros(0), np.array([0.0, 0.0, -9.81]), 0.0)


def reference(values: Floats) -> Reference:
    return Reference(values, 0.2 * values, 0.3 * values)


def test_torque_is_finite_and_one_per_joint(controller: Controller) -> None:
    tau = controller.torque(state(np.array([0.1, 0.2, 0.3])), reference(np.array([0.2, 0.1, 0.3])))
    assert tau.shape == (N,)
    assert tau.dtype == np.float64
    assert np.isfinite(tau).all()


def test_arguments_are_left_as_they_are(controller: Controller) -> None:
    measured, wanted = state(np.array([0.1, 0.2, 0.3])), reference(np.array([0.2, 0.1, 0.3]))
    before = [np.array(values) for values in (*measured, *wanted)]
    controller.torque(measured, wanted)
    for old, new in zip(before, (*measured, *wanted), strict=True):
        np.testing.assert_array_equal(old, new)


def test_every_torque_is_an_array_of_its_own(controller: Controller) -> None:
    measured, wanted = state(np.array([0.1, 0.2, 0.3])), reference(np.array([0.2, 0.1, 0.3]))
    first = controller.torque(measured, wanted)
    kept = first.copy()
    second = controller.torque(state(np.zeros(N)), wanted)
    assert not np.shares_memory(first, second)
    np.testing.assert_array_equal(first, kept)


def test_unmeasured_joint_gives_nan_for_itself_and_no_exception(controller: Controller) -> None:
    tau = controller.torque(state(np.array([0.1, np.nan, 0.3])), reference(np.array([0.2, 0.1, 0.3])))
    assert np.isnan(tau[1])


def test_read_only_arrays_are_taken(controller: Controller) -> None:
    measured, wanted = state(np.array([0.1, 0.2, 0.3])), reference(np.array([0.2, 0.1, 0.3]))
    expected = controller.torque(measured, wanted)
    for values in (*measured, *wanted):
        if isinstance(values, np.ndarray):
            values.setflags(write=False)
    np.testing.assert_array_equal(controller.torque(measured, wanted), expected)


def test_robot_of_another_size_is_refused(controller: Controller) -> None:
    with pytest.raises(InputError, match="joints"):
        controller.torque(state(np.zeros(N + 1)), reference(np.zeros(N + 1)))
