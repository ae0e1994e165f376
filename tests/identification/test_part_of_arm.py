"""An arm some of whose joints are held is the arm, and is identified as one of these joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_torque
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.workflows.identify import of_joints, part_of_arm
from moving_arm import LEVEL, recorded, sinusoids

HELD = {"ur10e": ("shoulder_pan_joint", "wrist_1_joint"), "dvrk_mtm_motors": ("q1", "q4"), "raven2": ("elbow",)}


@pytest.mark.parametrize("name", HELD)
def test_an_arm_with_held_joints_moves_as_the_whole_does(name):
    arm, rng = load_robot(name), np.random.default_rng(0)
    q, qd, _ = sinusoids(rng, arm, np.linspace(0.0, 1.0, 50))
    limits = {joint: np.clip([-0.3, 0.3], arm.lower[k], arm.upper[k]) for k, joint in enumerate(arm.joint_names)}
    at = {joint: rng.uniform(*limits[joint]) for joint in HELD[name]}
    for joint, place in at.items():
        q[:, arm.joint_names.index(joint)], qd[:, arm.joint_names.index(joint)] = place, 0.0
    log = MotionLog("run", arm.joint_names, arm.joint_units, q, np.ones(len(q), dtype=bool))
    joints = [joint for joint in arm.joint_names if joint not in at]
    part, held = part_of_arm(arm, joints, [log])
    assert part.joint_names == tuple(joints)
    assert held == pytest.approx(at, abs=1e-12)
    kept = [arm.joint_names.index(joint) for joint in joints]
    few = of_joints(log, part)
    assert_allclose(few.q_nominal, q[:, kept])
    if not arm.missing_inertia:
        whole = inverse_dynamics(arm, q, qd, 0.5 * qd, LEVEL)[:, kept]
        assert_allclose(inverse_dynamics(part, q[:, kept], qd[:, kept], 0.5 * qd[:, kept], LEVEL), whole, atol=1e-9)
    known = known_torque(arm.assumed_actuation, q)[:, kept]
    assert_allclose(known_torque(part.assumed_actuation, q[:, kept]), known, atol=1e-9)


def test_joints_that_are_unknown_or_move_are_refused_by_name():
    arm = load_robot("raven2")
    log = recorded(arm, 0, seconds=1.0)
    with pytest.raises(InputError, match='no joint "wrist"'):
        part_of_arm(arm, ["shoulder", "wrist"], [log])
    with pytest.raises(InputError, match="joint elbow is not among --joints, and moves from"):
        part_of_arm(arm, ["shoulder", "insertion"], [log])
