"""Motions that are followed in the gravity paper's experiments, and what its controllers leave of them."""

import numpy as np
from numpy.testing import assert_allclose

from catenary import load_robot
from catenary.dynamics.kinematics import forward_kinematics
from catenary.trajectories.cartesian import CartesianSinusoids
from catenary.workflows.gravity_trials import RAVEN_START
from papers.gravity.joint_3 import Variation, varied_joint_3
from papers.gravity.raven_base import raven_of_2014
from papers.gravity.tracking import INCREMENT, WorkspaceIncrements

AXES = ["x"]


def test_increments_add_up_to_the_motion_within_their_resolution() -> None:
    model = load_robot("raven2")
    motion = CartesianSinusoids(model, RAVEN_START, amplitude=0.005, period=0.4, cycles=1, axes=AXES)
    increments = WorkspaceIncrements(model, motion)
    times = np.arange(0.0, motion.duration, 0.001)
    q, qd, _ = increments.sample(times)
    tips = forward_kinematics(model, q)[1]
    # each increment is off by half a micrometre at most, mostly less, to either side
    assert_allclose(tips, motion.tip_positions(times), atol=40.0 * INCREMENT)
    assert not qd.any()
    assert_allclose(increments(motion.duration + 1.0).q, q[-1], atol=1e-6)


def test_only_joint_3_is_varied() -> None:
    nominal = raven_of_2014().cable
    rough = varied_joint_3(Variation("", friction=4.0)).cable
    assert_allclose(rough.link_friction / nominal.link_friction, [1.0, 1.0, 4.0])
    assert_allclose(rough.coupling, nominal.coupling)
    wound = varied_joint_3(Variation("", coupling=0.7)).cable
    # c01 is joint 2's
    assert_allclose(wound.coupling / nominal.coupling, [1.0, 0.7, 0.7])
    assert_allclose(wound.rotor_friction, nominal.rotor_friction)
