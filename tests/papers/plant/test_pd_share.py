import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, Reference, gravity_torque, load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.simulated_plant import PERIOD
from catenary.spatial import LEVEL
from papers.gravity.raven_base import turned_base
from papers.plant.pd_share import HOLD, LOOKED_AT, MOVE, POSES_DEG, HeldTool, pd_share, poses_of_joint_1

ARM = load_cable_arm()
HOME = np.append(np.array([0.5, 1.5, 0.4]), np.zeros(4))
TILTED = turned_base(25.0).sample(np.zeros(1)).gravity[0]


def _state(gravity: np.ndarray) -> JointState:
    return JointState(0.0, HOME, np.zeros(7), np.zeros(7), np.zeros(7), gravity, 0.0)


@pytest.mark.parametrize(("sensed", "gravity"), [(True, TILTED), (False, LEVEL)])
def test_without_error_the_torque_is_that_of_believed_gravity(sensed: bool, gravity: np.ndarray) -> None:
    controller = HeldTool(ARM.firmware, sensed=sensed)
    tau = controller.torque(_state(TILTED), Reference(HOME, np.zeros(7), np.zeros(7)))
    assert_allclose(tau[:3], gravity_torque(load_robot("raven2"), HOME[:3], gravity))
    assert_allclose(controller.feedback, 0.0)


def test_the_arm_rests_while_it_is_looked_at() -> None:
    path = poses_of_joint_1(HOME)
    for k, pose in enumerate(POSES_DEG):
        end = (k + 1) * (MOVE + HOLD)
        for t in (end - LOOKED_AT, end - PERIOD):
            q, qd, _ = path(t)
            assert_allclose(q[0], np.deg2rad(pose))
            assert_allclose(qd, 0.0, atol=1e-12)


@pytest.mark.slow
def test_on_a_tilted_base_sensed_gravity_spares_pd_and_level_gravity_does_not() -> None:
    sensed, level = (pd_share(ARM, 25.0, sensed=sensed).share[0] for sensed in (True, False))
    assert sensed < 15.0
    assert level > 40.0
