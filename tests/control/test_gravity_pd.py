from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.control.gravity_pd import GravityHold, GravityPD
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
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


def state(gravity: Floats = TILTED, rates: Floats | None = None) -> JointState:
    at = JointState(0.0, Q, QD, np.zeros(3), np.zeros(0), gravity, 0.0)
    return at if rates is None else at._replace(base_rates=rates)


def test_static_gravity_does_not_look_at_what_is_sensed() -> None:
    controller = GravityPD(ARM, KP, KD, gravity=LEVEL)
    assert_allclose(
        controller.torque(state(rates=RATES), REFERENCE), PD + gravity_torque(ARM, Q, LEVEL), rtol=1e-13
    )


def test_dynamic_gravity_follows_what_is_sensed() -> None:
    controller = GravityPD(ARM, KP, KD)
    assert_allclose(controller.torque(state(), REFERENCE), PD + gravity_torque(ARM, Q, TILTED), rtol=1e-13)


def test_dynamic_gravity_on_a_turning_base_takes_the_whole_term() -> None:
    expected = PD + inverse_dynamics(ARM, Q, np.zeros(3), np.zeros(3), TILTED, BaseMotion(RATES[0], RATES[1]))
    assert_allclose(GravityPD(ARM, KP, KD).torque(state(rates=RATES), REFERENCE), expected, rtol=1e-12)


def test_gravity_at_the_desired_position_is_that_of_the_reference() -> None:
    controller = GravityPD(ARM, KP, KD, at="desired")
    controller.torque(state(), REFERENCE)
    assert_allclose(controller.feedforward, gravity_torque(ARM, Q_REF, TILTED), rtol=1e-13)


def test_absolute_damping_lags_a_moving_reference() -> None:
    controller = GravityPD(ARM, KP, KD, damping="absolute")
    controller.torque(state(), REFERENCE)
    assert_allclose(controller.feedback, KP * (Q_REF - Q) - KD * QD, rtol=1e-13)


def test_hold_gives_gravity_and_nothing_else() -> None:
    hold = GravityHold(ARM)
    assert_allclose(hold.torque(state(), REFERENCE), gravity_torque(ARM, Q, TILTED), rtol=1e-13)
    assert (hold.feedback == 0.0).all()


def test_hold_does_not_look_at_the_reference() -> None:
    nowhere = Reference(*np.full((3, 3), np.nan))
    assert np.isfinite(GravityHold(ARM).torque(state(), nowhere)).all()


def test_unknown_gravity_gives_nan_and_not_zero() -> None:
    assert np.isnan(GravityPD(ARM, KP, KD).torque(state(np.full(3, np.nan)), REFERENCE)).all()
    assert np.isnan(GravityHold(ARM).torque(state(np.full(3, np.nan)), REFERENCE)).all()


def test_velocity_that_is_left_out_may_be_unknown() -> None:
    reference = Reference(Q_REF, np.full(3, np.nan), np.zeros(3))
    controller = GravityPD(ARM, KP, KD, damping="absolute")
    assert np.isfinite(controller.torque(state(), reference)).all()


def test_arm_without_inertia_is_refused_by_its_links() -> None:
    bare = replace(ARM, missing_inertia=("elbow",))
    for make in (lambda: GravityPD(bare, KP, KD), lambda: GravityHold(bare)):
        with pytest.raises(MissingInertiaError, match="elbow"):
            make()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kp": KP[:2]}, "kp: expected shape"),
        ({"kd": -KD}, "kd: expected gains of zero or more"),
        ({"gravity": [0.0, 1.0]}, "gravity: expected shape"),
        ({"gravity": [0.0, np.nan, 1.0]}, "gravity"),
        ({"at": "nowhere"}, "expected one of measured, desired"),
        ({"damping": "none"}, "expected one of relative, absolute"),
    ],
)
def test_impossible_settings_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        GravityPD(ARM, **{"kp": KP, "kd": KD, **options})  # type: ignore[arg-type]


def test_angular_acceleration_of_the_base_loads_the_raven_as_much_as_rocking_gravity_does() -> None:
    # rocked between 10 and 20 deg at 1 Hz about joint 1's axis, as in the 2014 paper: 0.74 Nm of torque swing
    alpha = np.deg2rad(5.0) * (2.0 * np.pi) ** 2
    placed = state(LEVEL)._replace(q=np.array([np.pi / 6, np.pi / 2, 0.40]))
    rocked = placed._replace(base_rates=np.array([[0.0, 0.0, 0.0], [0.0, alpha, 0.0]]))
    hold = GravityHold(ARM)
    swing = 2.0 * abs(hold.torque(rocked, REFERENCE) - hold.torque(placed, REFERENCE))[0]
    assert 0.4 < swing < 1.0  # of the order of the holding torque
