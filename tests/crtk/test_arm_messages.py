"""What a served robot says and answers, beside what its arms' plants, kinematics and telemetry say."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import pose_of
from catenary.crtk.serving.crtk_dialect import _FORWARD, _INVERSE
from catenary.dynamics.kinematics import forward_kinematics, relative_pose
from catenary.nodes.serve import Serving, make_server
from catenary.raven2.topics import Arm
from catenary.robots.catalog import load_robot
from oracles.cable_arms import homed_plant
from served_robot import ServedRobot, answered

ARMS: tuple[Arm, ...] = ("gold", "green")


class Said:
    """A robot with two arms that move, and what it says on each topic in its last tick."""

    def __init__(self, dialect: Any) -> None:
        network = LoopbackNetwork()
        plants: Any = {"gold": homed_plant("left"), "green": homed_plant("right")}
        server = make_server(Serving(dialect=dialect), Loopback("robot", network), plants=plants)
        client = Loopback("client", network)
        heard = {key: client.subscribe(one.topic.name, one.topic.type) for key, one in server.publishers.items()}
        for lazy in server.publishers.values():
            lazy.watch()
        rng = np.random.default_rng(5)
        for _ in range(40):
            for arm in server.arms.values():
                arm.increment(rng.uniform(-1.0, 1.0, 7) * arm.most)
            server.tick()
        self.dialect, self.arms = dialect, server.arms
        self.messages = {key: got[-1].message for key, one in heard.items() if (got := one.take())}


@pytest.fixture(scope="module", params=["raven", "crtk"])
def said(request: pytest.FixtureRequest) -> Said:
    return Said(request.param)


def at_tip(q: Any) -> list[float]:
    """The model's joints at the robot's: half the difference of the jaws turns the tool."""
    return [*q[:5], 0.5 * (q[6] - q[5])]


@pytest.mark.parametrize("arm", ARMS)
def test_joint_states_are_the_plants(said: Said, arm: Arm) -> None:
    served = said.arms[arm]
    for verb, state in (("measured_js", served.plant.measured_js()), ("setpoint_js", served.plant.setpoint_js())):
        message = said.messages[verb, arm]
        assert message.name == served.plant.joint_names
        assert np.abs(message.position).min() > 0.0
        assert_array_equal(message.position, state.q)
        assert_array_equal(message.velocity, state.qd)
        assert_array_equal(message.effort, state.tau)


@pytest.mark.parametrize("arm", ARMS)
def test_the_opening_of_the_jaws_is_their_sum_and_its_effort_their_mean(said: Said, arm: Arm) -> None:
    is_raven = said.dialect == "raven"
    message = said.messages["grasp_measured_js" if is_raven else "jaw/measured_js", arm]
    state = said.arms[arm].plant.measured_js()
    # three names and positions, one velocity, one effort [raven2, branch crtk: publish_crtk_measured_gr_js]
    assert message.name == ((f"{arm}_grasp", f"{arm}_jaw1", f"{arm}_jaw2") if is_raven else ("jaw",))
    assert_allclose(message.position, [state.q[-2:].sum(), *(state.q[-2:] if is_raven else ())])
    assert_allclose([*message.velocity, *message.effort], [state.qd[-2:].sum(), state.tau[-2:].mean()])


@pytest.mark.parametrize("arm", ARMS)
def test_poses_are_those_of_forward_kinematics(said: Said, arm: Arm) -> None:
    served = said.arms[arm]
    assert served.tool is not None
    for verb, state in (("measured_cp", served.plant.measured_js()), ("setpoint_cp", served.plant.setpoint_js())):
        message, expected = said.messages[verb, arm], forward_kinematics(served.tool.model, at_tip(state.q))
        assert message.header.frame_id == "base"
        assert said.dialect == "crtk" or message.child_frame_id == "tool"
        assert_allclose(pose_of(message).position, expected.position, atol=1e-12)
        assert_allclose(pose_of(message).rotation, expected.rotation, atol=1e-12)


def test_all_messages_of_a_tick_have_its_stamp(said: Said) -> None:
    every_tick = [m[0].stamp for (verb, _), m in said.messages.items() if verb.endswith(("_js", "_cp", "_cv"))]
    assert len(set(every_tick)) == 1


def test_the_whole_state_is_in_the_robots_own_units() -> None:
    said = Said("raven")
    message, degrees = said.messages["ravenstate", None], 180.0 / np.pi
    assert (message.runlevel, message.sublevel, message.dt) == (3, 1, 1_000_000)
    for k, arm in enumerate(ARMS):
        served = said.arms[arm]
        assert served.tool is not None
        own, channels = served.plant.telemetry(), 8 * k + np.array([0, 1, 2, 4, 5, 6, 7])
        for name in ("mpos", "jpos", "mvel", "jvel", "mpos_d", "jpos_d"):
            assert_allclose(getattr(message, name)[channels], degrees * own[name], rtol=1e-6, err_msg=name)
            assert getattr(message, name)[8 * k + 3] == 0.0  # the channel that is not used
        for name in ("tau", "encVals", "dac_val", "encoffsets"):
            assert_allclose(getattr(message, name)[channels], own[name], rtol=1e-6, err_msg=name)
        for state, position, rotation in (
            (served.plant.measured_js(), message.pos, message.ori),
            (served.plant.setpoint_js(), message.pos_d, message.ori_d),
        ):
            pose = relative_pose(served.tool.model, at_tip(state.q), "tool", "frame0")
            assert_allclose(position[3 * k : 3 * k + 3], 1e6 * pose.position, atol=1.0)  # whole um
            assert_allclose(rotation[9 * k : 9 * k + 9], pose.rotation.ravel(), atol=1e-6)
        twist = served.measured_tool.twist.reshape(2, 3) @ served.measured_tool.pose.rotation  # in the tool's axes
        assert np.abs(twist).max() > 1e-3
        assert_allclose(message.jac_vel[6 * k : 6 * k + 6], twist.ravel(), rtol=1e-5, atol=1e-7)
        assert message.grasp_d[k] == np.float32(served.plant.setpoint_js().q[-2:].sum())


PoseStamped = message_class("geometry_msgs/PoseStamped")
Q = [0.7, 1.4, 0.4, 0.3, 0.2, 0.1, 0.5]


@pytest.fixture(scope="module")
def robot() -> ServedRobot:
    return ServedRobot("crtk", state="DISABLED")


def ask(robot: ServedRobot, kind: str, **request: Any) -> Any:
    name = "forward" if kind == _FORWARD else "inverse"
    return answered(robot.server, f"/arm1/{name}_kinematics", kind, **request)


def test_forward_and_back(robot: ServedRobot) -> None:
    found = ask(robot, _FORWARD, jp=Q)
    assert (found.result, found.message) == (True, "")
    pose = pose_of(PoseStamped(header(0), found.cp))
    expected = forward_kinematics(load_robot("raven2_full"), [*Q[:5], 0.5 * (Q[6] - Q[5])])
    assert_allclose(pose.position, expected.position, atol=1e-12)
    assert_allclose(pose.rotation, expected.rotation, atol=1e-12)
    back = ask(robot, _INVERSE, cp=found.cp, jp=Q)
    assert back.result
    assert_allclose(back.jp, Q, atol=1e-6)
    assert robot.server.arms["gold"].state.state == "DISABLED"


def test_without_joints_the_setpoint_is_near(robot: ServedRobot) -> None:
    here = robot.server.arms["gold"].setpoint.q
    pose = ask(robot, _FORWARD, jp=here).cp
    assert_allclose(ask(robot, _INVERSE, cp=pose).jp, here, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "request_", "said"),
    [
        (_FORWARD, {"jp": [0.1, 0.2]}, "jp"),
        (_FORWARD, {"jp": [np.nan] * 7}, "jp"),
        (_INVERSE, {"jp": Q}, "expected length 1"),
        (_INVERSE, {"jp": Q, "x": 9.0}, "the arm's reach"),
    ],
)
def test_what_cannot_be_answered_says_why(robot: ServedRobot, kind: str, request_: Any, said: str) -> None:
    x = request_.pop("x", None)
    if x is not None:
        pose = ask(robot, _FORWARD, jp=Q).cp
        request_["cp"] = pose._replace(position=pose.position._replace(x=x))
    found = ask(robot, kind, **request_)
    assert not found.result
    assert said in found.message
