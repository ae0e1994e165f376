from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from catenary.calibration.corrector import Corrector
from catenary.control.limits import TorqueLimits
from catenary.control.pd import JointPD
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_kernel
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference
from catenary.workflows.control_tick import ControlTick
from oracles.calibration_models import random_model

ROBOT = load_robot("raven2")
RNG = np.random.default_rng(1)


def limits_of(n: int) -> TorqueLimits:
    return TorqueLimits(
        np.full(n, 3.0),
        slew=np.full(n, 2e3),
        lower=np.full(n, -1.0),
        upper=np.full(n, 2.0),
        taper=np.full(n, 0.3),
    )


def corrector_of(rng: np.random.Generator) -> Corrector:
    """A network with memory and torques, of the robot's own joints."""
    signals = rng.normal(size=(2000, 6))
    model = random_model("tanh, skip", signals, rng, joints=3, torques=3, history=2, plays=1, rate_hz=1000.0)

    def named(text: str) -> str:
        return text.replace("j0", "shoulder").replace("j1", "elbow").replace("j2", "insertion")

    features = replace(
        model.features,
        signals=tuple(map(named, model.features.signals)),
        play=tuple((named(signal), width) for signal, width in model.features.play),
    )
    return Corrector(
        replace(model, joint_names=ROBOT.joint_names, joint_units=ROBOT.joint_units, features=features)
    )


def states(count: int):
    rng = np.random.default_rng(2)
    for k in range(count):
        q, qd, tau, q_ref, qd_ref = rng.normal(size=(5, 3))
        if k % 17 == 5:
            q[k % 3] = np.nan
        gravity = np.array([0.0, 0.0, -9.81]) + rng.normal(size=3)
        yield (
            JointState(0.001 * k, q, qd, tau, np.zeros(0), gravity, 0.0),
            Reference(q_ref, qd_ref, np.zeros(3)),
        )


@pytest.mark.parametrize("corrected", [False, True])
def test_a_tick_is_its_parts_one_after_the_other_to_the_bit(corrected: bool) -> None:
    pd = JointPD([10.0, 12.0, 100.0], [0.5, 0.4, 3.0])
    make = (lambda: corrector_of(np.random.default_rng(3))) if corrected else (lambda: None)
    tick = ControlTick(ROBOT, pd, limits_of(3), make())
    limits, corrector, kernel = limits_of(3), make(), gravity_kernel(ROBOT)
    limits.reset(np.zeros(3))
    if corrector is not None:
        corrector.prepare(ROBOT.joint_names, ROBOT.joint_units, 1000.0)
    were_inside = 0
    for state, reference in states(300):
        q, inside = state.q.copy(), np.ones(3, dtype=bool)
        if corrector is not None:
            corrector.correct_state(state, q, inside)
        at = JointState(state.time, q, *state[2:])
        wanted = pd.torque(at, reference) + kernel(q, state.gravity)
        sent = tick.torque(state, reference)
        assert sent.tobytes() == limits.apply(wanted, state.q, 0.001).tobytes()
        assert tick.q_calibrated.tobytes() == q.tobytes()
        assert (tick.inside == inside).all()
        were_inside += int(inside.all())
    assert np.isfinite(sent).all()
    assert were_inside > 0
    assert (limits.limited, limits.not_finite) == (tick.limits.limited, tick.limits.not_finite)


def test_a_copy_goes_on_apart() -> None:
    pd, limits = JointPD(np.ones(3), np.ones(3)), limits_of(3)
    tick = ControlTick(ROBOT, pd, limits, corrector_of(np.random.default_rng(3)))
    pairs = list(states(30))
    for pair in pairs[:10]:
        tick.torque(*pair)
    twin = deepcopy(tick)
    assert twin.q_calibrated.tobytes() == tick.q_calibrated.tobytes()
    later = [tick.torque(*pair) for pair in pairs[10:]]
    assert np.array_equal(later, [twin.torque(*pair) for pair in pairs[10:]])
    assert twin.limits is not limits


def test_arrays_of_another_type_or_layout_are_copied() -> None:
    pd = JointPD(np.ones(3), np.ones(3))
    ((state, reference),) = states(1)
    expected = ControlTick(ROBOT, pd).torque(state, reference)
    apart = state._replace(q=np.repeat(state.q, 2)[::2], gravity=list(state.gravity))
    assert np.array_equal(ControlTick(ROBOT, pd).torque(apart, reference), expected)


def test_reset_forgets_torques_and_positions() -> None:
    tick = ControlTick(
        ROBOT, JointPD(np.ones(3), np.ones(3)), limits_of(3), corrector_of(np.random.default_rng(3))
    )
    first = [tick.torque(*pair) for pair in states(20)]
    tick.reset(np.zeros(3))
    assert np.array_equal(first, [tick.torque(*pair) for pair in states(20)])


def test_a_tick_for_other_joints_is_refused() -> None:
    pd = JointPD(np.ones(3), np.ones(3))
    with pytest.raises(InputError, match="gains are of 2, limits of 3"):
        ControlTick(ROBOT, JointPD(np.ones(2), np.ones(2)))
    with pytest.raises(InputError, match="limits of 4"):
        ControlTick(ROBOT, pd, limits_of(4))
    with pytest.raises(InputError, match="rate_hz"):
        ControlTick(ROBOT, pd, rate_hz=0.0)
    with pytest.raises(MissingInertiaError):
        ControlTick(replace(ROBOT, missing_inertia=("link",)), pd)
    tick = ControlTick(ROBOT, pd)
    ((state, reference),) = states(1)
    with pytest.raises(InputError, match="of 3 joints"):
        tick.torque(state._replace(qd=np.zeros(2)), reference)
