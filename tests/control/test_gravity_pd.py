import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.control.pd import EstimatedGravityPD, GravityHold, GravityPD
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.estimator import GravityEstimator
from catenary.gravity.torque import gravity_torque
from catenary.plant import AT_REST, JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference

ARM = load_robot("raven2")
KP, KD = np.array([450.0, 360.0, 5e4]), np.array([12.0, 9.0, 4e3])
LEVEL, TILTED = np.array([0.0, 0.0, -9.81]), np.array([3.0, -1.0, -9.2])
Q, QD = np.array([0.5, 1.4, 0.4]), np.array([0.1, -0.2, 0.01])
Q_REF, QD_REF = np.array([0.52, 1.38, 0.401]), np.array([0.2, 0.1, 0.02])
REFERENCE = Reference(Q_REF, QD_REF, np.zeros(3))
PD = KP * (Q_REF - Q) + KD * (QD_REF - QD)
RATES = np.array([[0.1, -0.2, 0.3], [1.0, 2.0, -0.5]])


def state(gravity: Floats = TILTED, rates: Floats = AT_REST) -> JointState:
    return JointState(0.0, Q, QD, np.zeros(3), np.zeros(0), gravity, 0.0, rates)


@pytest.mark.parametrize(
    ("options", "rates", "expected"),
    [
        ({"gravity": LEVEL}, RATES, lambda: gravity_torque(ARM, Q, LEVEL)),
        ({}, AT_REST, lambda: gravity_torque(ARM, Q, TILTED)),
        ({}, RATES, lambda: inverse_dynamics(ARM, Q, np.zeros(3), np.zeros(3), TILTED, BaseMotion(*RATES))),
    ],
    ids=["static: whatever is sensed", "dynamic", "dynamic on a turning base"],
)
def test_torque_is_the_pds_and_gravitys(options, rates, expected) -> None:
    controller = GravityPD(ARM, KP, KD, **options)
    assert_allclose(controller.torque(state(rates=rates), REFERENCE), PD + expected(), rtol=1e-12)
    assert_allclose(controller.feedforward, expected(), rtol=1e-12)


def test_absolute_damping_leaves_the_velocity_of_the_reference_out() -> None:
    controller = GravityPD(ARM, KP, KD, damping="absolute")
    controller.torque(state(), Reference(Q_REF, np.full(3, np.nan), np.zeros(3)))
    assert_allclose(controller.feedback, KP * (Q_REF - Q) - KD * QD, rtol=1e-13)


def test_hold_gives_gravity_and_does_not_look_at_the_reference() -> None:
    hold, nowhere = GravityHold(ARM), Reference(*np.full((3, 3), np.nan))
    assert_allclose(hold.torque(state(), nowhere), gravity_torque(ARM, Q, TILTED), rtol=1e-13)
    assert (hold.feedback == 0.0).all()


@pytest.mark.parametrize("controller", [GravityPD(ARM, KP, KD), GravityHold(ARM)])
def test_unknown_gravity_gives_nan_and_not_zero(controller) -> None:
    assert np.isnan(controller.torque(state(np.full(3, np.nan)), REFERENCE)).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kp": KP[:2]}, "kp: expected shape"),
        ({"kd": -KD}, "kd: expected zero or more"),
        ({"gravity": [0.0, 1.0]}, "gravity: expected shape"),
        ({"gravity": [0.0, np.nan, 1.0]}, "gravity"),
        ({"damping": "none"}, "expected one of relative, absolute"),
    ],
)
def test_impossible_settings_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        GravityPD(ARM, **{"kp": KP, "kd": KD, **options})  # type: ignore[arg-type]


def test_torque_is_the_pds_and_the_estimated_gravity() -> None:
    estimator = GravityEstimator(ARM, KP, KD, s0=compact_regressor(ARM).parameters())
    tau = EstimatedGravityPD(KP, KD, estimator).torque(state(), REFERENCE)
    # at the first tick no time has passed: the parameters are still those that it began with
    assert_allclose(tau, PD + gravity_torque(ARM, Q, TILTED), rtol=1e-12)
