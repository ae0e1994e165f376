import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.sensing.vector import tilted_gravity
from catenary.workflows.robot.operated_robot import robot_over, simulated_robot
from catenary.workflows.robot.operator_motion import go_to_joints
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import RobotOnLoopback


@pytest.mark.parametrize(("dialect", "side"), [("raven", "left"), ("crtk", "right")])
def test_a_robot_behind_topics_is_moved_like_any_other(dialect: str, side: str) -> None:
    arm, name = ("gold", "raven2") if side == "left" else ("green", "raven2_right")
    setup = RobotOnLoopback(homed_plant(side), dialect=dialect, arm=arm)
    robot, client = robot_over(setup.transport, name, dialect=dialect, simulated=True)
    with client:
        goal = client.setpoint_js().q[:3] + np.array([0.02, -0.02, 0.002])
        summary = go_to_joints(robot, goal)
        assert_allclose(client.setpoint_js().q[:3], goal, atol=1e-6)  # a float's digits, on the wire
    assert summary.state.state == "PAUSED"


def test_a_simulated_base_may_be_tilted() -> None:
    robot = simulated_robot(base_tilt_deg=(10.0, -5.0), homed=False, real_time=False)
    expected = tilted_gravity(np.deg2rad(10.0), np.deg2rad(-5.0))
    assert_allclose(robot.plant.measured_js().gravity, expected, atol=1e-12)


def test_a_seed_for_a_robot_that_is_always_the_same_and_an_unknown_dialect_are_refused() -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(InputError, match="no other"):
        simulated_robot("planar_3r", seed=3)
    with pytest.raises(InputError, match="raven, crtk"):
        robot_over(RobotOnLoopback(homed_plant("left")).transport, dialect="latin")


@pytest.mark.parametrize("name", ["raven2", "raven2_right", "dvrk_psm", "planar_3r"])
def test_a_name_is_one_robot_whether_it_moves_or_is_asked_of_the_catalogue(name: str) -> None:
    pytest.importorskip("mujoco")
    robot, known = simulated_robot(name, homed=False, real_time=False), load_robot(name)
    assert (robot.name, robot.model.joint_names) == (name, known.joint_names)
    assert robot.plant.joint_names[:3] == known.joint_names[:3] or name in RAVEN_SIDES
