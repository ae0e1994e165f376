"""CRTK's kinematics services, beside the kinematics of the robot's model."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.conversions import pose_of
from catenary.crtk.message import header, message_class
from catenary.crtk.serving.kinematics_services import FORWARD, INVERSE
from catenary.dynamics.kinematics import forward_kinematics
from catenary.robots.catalog import load_robot
from served_robot import ServedRobot

PoseStamped = message_class("geometry_msgs/PoseStamped")
Q = [0.7, 1.4, 0.4, 0.3, 0.2, 0.1, 0.5]


@pytest.fixture(scope="module")
def robot() -> ServedRobot:
    return ServedRobot("crtk", state="DISABLED")


def ask(robot: ServedRobot, kind: str, **request: Any) -> Any:
    name = "forward" if kind == FORWARD else "inverse"
    asked = message_class(f"{kind}Request")(**request)
    return robot.client.call(f"/arm1/{name}_kinematics", kind, asked)


def test_forward_and_back(robot: ServedRobot) -> None:
    found = ask(robot, FORWARD, jp=Q)
    assert (found.result, found.message) == (True, "")
    pose = pose_of(PoseStamped(header(0), found.cp))
    expected = forward_kinematics(load_robot("raven2_full"), [*Q[:5], 0.5 * (Q[6] - Q[5])])
    assert_allclose(pose.position, expected.position, atol=1e-12)
    assert_allclose(pose.rotation, expected.rotation, atol=1e-12)
    back = ask(robot, INVERSE, cp=found.cp, jp=Q)
    assert back.result
    assert_allclose(back.jp, Q, atol=1e-6)
    assert robot.server.arms["gold"].state.state == "DISABLED"


def test_without_joints_the_setpoint_is_near(robot: ServedRobot) -> None:
    here = robot.server.arms["gold"].setpoint.q
    pose = ask(robot, FORWARD, jp=here).cp
    assert_allclose(ask(robot, INVERSE, cp=pose).jp, here, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "request_", "said"),
    [
        (FORWARD, {"jp": [0.1, 0.2]}, "jp"),
        (FORWARD, {"jp": [np.nan] * 7}, "jp"),
        (INVERSE, {"jp": Q}, "expected length 1"),
        (INVERSE, {"jp": Q, "x": 9.0}, "the arm's reach"),
    ],
)
def test_what_cannot_be_answered_says_why(robot: ServedRobot, kind: str, request_: Any, said: str) -> None:
    x = request_.pop("x", None)
    if x is not None:
        pose = ask(robot, FORWARD, jp=Q).cp
        request_["cp"] = pose._replace(position=pose.position._replace(x=x))
    found = ask(robot, kind, **request_)
    assert not found.result
    assert said in found.message
