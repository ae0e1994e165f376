"""What dVRK's own classes use beside CRTK (dvrk_python: dvrk.arm, dvrk.psm, dvrk.system), call by call on a loopback."""

from itertools import groupby

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import command_message, pose_message, pose_of
from catenary.crtk.topic_names import CONSOLE_COMMANDS, console_topics
from catenary.simulation.psm_plant import PsmPlant
from catenary.spatial import Pose, rotation_from_rpy
from served_robot import PSM_TOPICS, ServedPsm, answered

Bool, Empty, Float64, String = (message_class(f"std_msgs/{name}") for name in ("Bool", "Empty", "Float64", "String"))
JointState, Twist = message_class("sensor_msgs/JointState"), message_class("geometry_msgs/TwistStamped")
# what dvrk.arm, dvrk.psm and dvrk.system wait for in check_connections: a peer at each [dvrk_python a1b337b]
ADVERTISED = {
    *(f"/PSM1/{verb}" for verb in ("state_command", "hold", "free", "servo_jp", "servo_jr", "servo_cp", "servo_jf")),
    *(f"/PSM1/{verb}" for verb in ("move_jp", "move_jr", "move_cp", "spatial/servo_cf", "body/servo_cf")),
    *(f"/PSM1/{verb}" for verb in ("body/set_cf_orientation_absolute", "use_gravity_compensation")),
    *(f"/PSM1/{verb}" for verb in ("trajectory_j/set_ratio", "emulate_tool_present")),
    *(f"/PSM1/jaw/{verb}" for verb in ("servo_jp", "move_jp", "servo_jf")),
    *(f"/{place}/{verb}" for place in ("system", "console") for verb in ("power_on", "power_off", "home")),
    *(f"/system/{verb}" for verb in ("set_volume", "beep", "string_to_speech")),
}
HEARD = {
    *(f"/PSM1/{verb}" for verb in ("operating_state", "setpoint_js", "setpoint_cp", "measured_js", "measured_cp")),
    *(f"/PSM1/{verb}" for verb in ("measured_cv", "trajectory_j/ratio", "local/measured_cp", "local/setpoint_cp")),
    *(f"/PSM1/{place}/{verb}" for place in ("spatial", "body") for verb in ("measured_cf", "jacobian")),
    *("/PSM1/jaw/measured_js", "/PSM1/jaw/setpoint_js"),
}
STEP = np.array([0.001, 0.0, 0.0, 0.0, 0.0, 0.0])
DEEP = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])  # dvrk_psm_test.py's starting position


@pytest.fixture
def psm():
    """Homed and enabled."""
    return ServedPsm()


def test_each_topic_that_their_classes_need_has_a_peer(psm):
    carrier = psm.server.transport
    assert set(psm.client.topics()) >= HEARD
    for name in sorted(ADVERTISED):
        psm.say(name, message_class(PSM_TOPICS[name].type)(), 0.0)
        assert carrier.connections(name).publishers, name


def test_their_psm_test_brings_arm_and_jaw_where_it_says(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    for opening, depth in ((-0.349, 0.11), (1.047, 0.13)):
        psm.joints("jaw/move_jp", [opening])
        psm.joints("move_jp", [*psm.setpoint[:2], depth, *psm.setpoint[3:6]])  # while the jaw still moves
        psm.wait()
        assert_allclose(psm.setpoint[[2, 6]], [depth, opening], atol=1e-9)
    for side, opening in ((-0.01, -0.349), (0.02, 1.047)):
        start = pose_of(psm.last("/PSM1/setpoint_cp"))
        goal = Pose(start.rotation, start.position + np.array([side, 0.0, 0.0]))
        psm.say("/PSM1/move_cp", pose_message(goal, 0, "base"))
        psm.joints("jaw/move_jp", [opening])  # while the arm still moves, or its way is still being planned
        psm.wait()
        assert_allclose(pose_of(psm.last("/PSM1/setpoint_cp")).position, goal.position, atol=1e-5)
        assert psm.setpoint[6] == pytest.approx(opening)
    assert not psm.refusals


def test_a_servo_jp_of_the_arm_lets_a_jaw_that_moves_go_on(psm):
    psm.joints("jaw/move_jp", [0.8])
    for _ in range(200):
        psm.joints("servo_jp", psm.setpoint[:6] + STEP, 0.01)
    assert_allclose(psm.setpoint[6], 0.8, atol=1e-9)
    assert psm.setpoint[0] > 0.1


@pytest.mark.parametrize("order", [1, -1])
def test_servo_commands_of_arm_and_jaw_in_one_tick_both_act(psm, order):
    goal = psm.setpoint[:6] + 150.0 * STEP
    for _ in range(10):  # as dvrk_teleoperation.py sends them
        for verb, q in (("servo_jp", goal), ("jaw/servo_jp", [0.5]))[::order]:
            psm.joints(verb, q, 0.0)
        psm.sleep(0.05)
    assert_allclose(psm.setpoint, [*goal, 0.5], atol=1e-9)


@pytest.mark.parametrize("stop", ["hold", "free"])
def test_what_stops_the_arm_stops_the_jaw(psm, stop):
    psm.joints("jaw/move_jp", [1.0], 0.3)
    psm.say(f"/PSM1/{stop}", Empty())
    psm.sleep(1.0)
    assert psm.setpoint[6] < 0.6


def test_a_ratio_makes_moves_slower_by_as_much(psm):
    took = {}
    for ratio in (1.0, 0.5, 0.1):
        psm.say("/PSM1/trajectory_j/set_ratio", Float64(data=ratio))
        assert psm.last("/PSM1/trajectory_j/ratio").data == ratio
        for place in (0.4, 0.0):
            psm.joints("move_jp", [place, *DEEP[1:]], 0.0)
            psm.sleep(0.005)
            took[ratio] = psm.wait()
    # from rest to rest: its length over its speed, and as long as it takes to get up to it, which ratio leaves as it is
    assert took[0.5] - took[1.0] == pytest.approx(0.4 / 0.8, abs=0.06)
    assert took[0.1] - took[1.0] == pytest.approx(9 * 0.4 / 0.8, abs=0.1)


@pytest.mark.parametrize("ratio", [0.0, -0.5, 1.01, np.nan, np.inf])
def test_a_ratio_that_is_none_changes_nothing_and_is_said(psm, ratio):
    heard = psm.hear("/PSM1/warning")
    psm.say("/PSM1/trajectory_j/set_ratio", Float64(data=ratio))
    assert psm.last("/PSM1/trajectory_j/ratio").data == 1.0
    assert "expected above 0 and at most 1" in heard.take()[-1].message.data


def test_ratios_of_speed_and_acceleration_are_one_ratio_only_where_they_agree(psm):
    psm.sleep(0.01)
    said = [psm.hear(f"/PSM1/trajectory_j/{name}") for name in ("ratio", "ratio_v", "ratio_a")]
    psm.say("/PSM1/trajectory_j/set_ratio_v", Float64(data=0.5))
    psm.say("/PSM1/trajectory_j/set_ratio_a", Float64(data=0.5))
    values = [[one.message.data for one in heard.take()] for heard in said]
    assert values == [[1.0, 0.0, 0.5], [1.0, 0.5], [1.0, 0.5]]


def test_goal_reached_tells_each_move_that_ends_and_how(psm):
    heard = psm.hear("/PSM1/goal_reached")
    for place in (0.1, 0.2):
        psm.joints("move_jp", [place, *DEEP[1:]])
        psm.wait()
    psm.joints("move_jp", [0.8, *DEEP[1:]], 0.2)
    psm.say("/PSM1/hold", Empty(), 0.2)
    assert [one.message.data for one in heard.take()] == [True, True, False]


def test_desired_state_is_where_the_arm_is_on_its_way_to():
    psm = ServedPsm(PsmPlant())
    psm.sleep(0.01)
    heard = psm.hear("/PSM1/desired_state")  # latched
    psm.say("/system/power_on", Empty(), 0.1)
    psm.say("/system/home", Empty(), 0.1)
    assert psm.plant.operating_state().is_busy
    psm.wait()
    psm.say("/system/power_off", Empty(), 0.1)
    states = [state for state, _ in groupby(one.message.data for one in heard.take())]
    assert states == ["DISABLED", "ENABLED", "HOMED", "DISABLED"]
    assert psm.plant.operating_state() == ("DISABLED", True, False)


@pytest.mark.parametrize("command", ["enable", "resume", "home", "pause", "disable", "unhome", "dance"])
@pytest.mark.parametrize("state", ["ENABLED", "PAUSED", "DISABLED"])
def test_each_state_command_is_answered_by_the_state_before_and_after_it(psm, command: str, state: str):
    if state != "ENABLED":
        psm.plant.state_command({"PAUSED": "pause", "DISABLED": "disable"}[state])
    psm.sleep(0.11)
    heard = psm.hear("/PSM1/operating_state")
    psm.sleep(0.01)
    heard.take()
    psm.say("/PSM1/state_command", command_message(command, 0), 0.01)
    before, *after = [one.message for one in heard.take()]
    assert before.state == state
    assert {one.state for one in after} == {psm.server.arms["PSM1"].state.state}
    assert after[0].header.stamp > before.header.stamp


def test_a_client_that_enables_what_is_enabled_is_answered_over_and_over(psm):
    heard = [psm.hear(f"/PSM1/{name}") for name in ("operating_state", "current_state", "desired_state")]
    for _ in range(3):
        psm.say("/PSM1/state_command", command_message("enable", 0))
        assert all(len(one) >= 2 for one in heard)
        assert {one.message.data for one in heard[1].take()} == {"HOMED"}
        heard[0].take(), heard[2].take()


@pytest.mark.parametrize(("age", "state"), [(3.0, "ENABLED"), (6.0, "DISABLED")])
def test_a_program_that_begins_by_enable_is_obeyed_though_it_was_found_seconds_later(psm, age: float, state: str):
    psm.plant.state_command("disable")
    psm.sleep(7.0)
    newcomer = Loopback("newcomer", psm.network)
    commands = newcomer.publisher("/PSM1/state_command", "crtk_msgs/StringStamped", latch=True)
    commands.publish(command_message("enable", psm.now() - round(1e9 * age)))
    psm.sleep(0.1)
    assert psm.server.arms["PSM1"].state.state == state
    commands.publish(command_message("enable", psm.now() - 2_000_000_000))  # its second one is not
    psm.sleep(0.1)
    assert psm.server.arms["PSM1"].state.state == state


def test_current_state_tells_that_an_arm_homes():
    psm = ServedPsm(PsmPlant())
    heard = psm.hear("/PSM1/current_state")  # latched
    psm.say("/system/home", Empty(), 0.1)
    psm.wait()
    psm.say("/PSM1/state_command", command_message("pause", 0), 0.1)
    states = [state for state, _ in groupby(one.message.data for one in heard.take())]
    assert states == ["DISABLED", "HOMING", "HOMED", "PAUSED"]


@pytest.mark.parametrize("place", ["console", "system"])
def test_home_of_the_console_enables_first(place):
    psm = ServedPsm(PsmPlant())
    psm.say(f"/{place}/home", Empty(), 0.1)
    psm.wait()
    assert psm.plant.operating_state() == ("ENABLED", True, False)


def test_the_console_of_an_arm_below_a_place_is_beside_it():
    names = {topic.name for topic in console_topics("/lab/PSM1")}
    assert names > {f"/lab/{place}/{verb[8:]}" for place in ("console", "system") for verb in CONSOLE_COMMANDS}


BASE = Pose(rotation_from_rpy((0.3, -0.4, 1.1)), np.array([0.2, -0.1, 0.5]))


def placed(psm):
    psm.say("/PSM1/set_base_frame", pose_message(BASE, 0, "cart"))


def test_poses_and_velocities_are_in_the_frame_that_was_set(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    placed(psm)
    psm.joints("servo_jp", psm.setpoint[:6] + 10 * STEP, 0.002)
    whole, local = psm.last("/PSM1/setpoint_cp"), psm.last("/PSM1/local/setpoint_cp")
    assert (whole.header.frame_id, local.header.frame_id) == ("cart", "base")
    expected = BASE @ pose_of(local)
    assert_allclose(pose_of(whole).position, expected.position, atol=1e-12)
    assert_allclose(pose_of(whole).rotation, expected.rotation, atol=1e-12)
    # a velocity is the change of the pose over time
    heard, poses = psm.hear("/PSM1/measured_cv"), psm.hear("/PSM1/measured_cp")
    psm.joints("move_jp", [0.5, *DEEP[1:]], 0.7)
    step = 10  # ms
    velocity = [one.message.twist.linear for one in heard.take()][-step // 2]
    tip = [one.message.pose.position for one in poses.take()]
    difference = (np.array(tip[-1]) - np.array(tip[-1 - step])) / (0.001 * step)
    assert_allclose(velocity, difference, atol=0.1 * np.linalg.norm(difference))  # encoders' steps, over 10 ms


@pytest.mark.alike
@pytest.mark.parametrize("verb", ["servo_cp", "move_cp", "servo_cr", "move_cr", "servo_cv"])
def test_a_cartesian_command_is_in_the_frame_that_was_set(psm, verb):
    psm.joints("move_jp", DEEP)
    psm.wait()
    placed(psm)
    start = pose_of(psm.last("/PSM1/setpoint_cp"))
    step = np.array([0.001, 0.002, -0.001]) * (1 if verb.startswith("servo") else 5)
    if verb == "servo_cv":
        vector, twist = (message_class(f"geometry_msgs/{name}") for name in ("Vector3", "Twist"))
        message = Twist(header(0, "cart"), twist(vector(*(20 * step)), vector()))
    elif verb.endswith("cr"):
        message = pose_message(Pose(np.eye(3), 0.02 * step if verb == "servo_cr" else step), 0, "cart")
    else:
        message = pose_message(Pose(start.rotation, start.position + step), 0, "cart")
    psm.say(f"/PSM1/{verb}", message)
    psm.wait()
    psm.sleep(0.3)
    moved = pose_of(psm.last("/PSM1/setpoint_cp")).position - start.position
    assert np.linalg.norm(moved) > 1e-6
    assert_allclose(moved / np.linalg.norm(moved), step / np.linalg.norm(step), atol=0.02)


def kinematics(psm, place, q):
    kind = "crtk_msgs/QueryForwardKinematics"
    answer = answered(psm.server, f"/PSM1/{place}forward_kinematics", kind, jp=q)
    assert answer.result
    return message_class("geometry_msgs/PoseStamped")(pose=answer.cp), answer.cp


def test_kinematics_are_in_the_frame_that_was_set_and_local_ones_in_the_arms_own(psm):
    placed(psm)
    q = DEEP + np.array([0.1, -0.1, 0.02, 0.3, 0.2, -0.1])
    (whole, cp), (local, _) = kinematics(psm, "", q), kinematics(psm, "local/", q)
    assert_allclose(pose_of(whole).position, (BASE @ pose_of(local)).position, atol=1e-12)
    kind = "crtk_msgs/QueryInverseKinematics"
    answer = answered(psm.server, "/PSM1/inverse_kinematics", kind, cp=cp, jp=q + 0.01)
    assert_allclose(answer.jp, q, atol=1e-6)


def test_actuators_are_turned_into_the_joints_whose_motors_they_are(psm):
    psm.joints("jaw/move_jp", [0.5])
    psm.joints("move_jp", [0.1, -0.1, 0.13, 0.4, -0.3, 0.2])
    psm.wait()
    motors, q = psm.plant.control.motor, psm.plant.measured_js().q
    turned, kind = motors / psm.plant.firmware.ratio, "cisst_msgs/ConvertFloat64Array"
    answer = answered(psm.server, "/PSM1/actuator_to_joint_position", kind, input=turned)
    assert_allclose(answer.output, q, atol=1e-9)


def test_a_tool_is_the_one_that_is_there(psm):
    assert psm.last("/PSM1/tool_type").data == "LARGE_NEEDLE_DRIVER:400006[..]"
    psm.say("/PSM1/set_tool_type", String(data="LARGE_NEEDLE_DRIVER:400006"))
    psm.say("/PSM1/emulate_tool_present", Bool(data=True))
    assert not psm.refusals
    psm.say("/PSM1/set_tool_type", String(data="CADIERE_FORCEPS:400049"))
    psm.say("/PSM1/emulate_tool_present", Bool(data=False))
    assert len(psm.refusals) == 2


def test_settings_move_nothing_and_hold_no_arm(psm):
    before = psm.setpoint.copy()
    for name in ("trajectory_j/set_ratio", "set_base_frame", "set_tool_type", "emulate_tool_present"):
        assert not PSM_TOPICS[f"/PSM1/{name}"].moves
    psm.say("/PSM1/trajectory_j/set_ratio", Float64(data=0.5))
    placed(psm)
    assert_array_equal(psm.setpoint, before)
    other = Loopback("other", psm.network)
    other.publisher("/PSM1/move_jp", "sensor_msgs/JointState").publish(JointState(position=DEEP + 0.01))
    psm.sleep(0.05)
    assert psm.server.arms["PSM1"].state.is_busy


JointServo, Mode = message_class("crtk_msgs/JointServo"), message_class("crtk_msgs/SetpointMode")
CartesianState = message_class("crtk_msgs/CartesianState")
P, V, PV, F, PVF = (Mode(value) for value in (1, 2, 3, 4, 7))


def test_positions_come_at_the_velocity_in_the_same_message(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    goal, speed = DEEP + 20 * STEP, np.array([0.1, *np.zeros(5)])
    psm.say("/PSM1/servo_js", JointServo(position=goal, velocity=speed, mode=(PV,) * 6), 0.05)
    assert psm.setpoint[0] == pytest.approx(0.1 * 0.05, abs=2e-4)
    for _ in range(10):
        psm.say("/PSM1/servo_js", JointServo(position=goal, velocity=speed), 0.02)
    assert_allclose(psm.setpoint[:6], goal, atol=1e-9)  # and never beyond
    psm.say("/PSM1/servo_js", JointServo(position=DEEP, mode=(P,) * 6), 0.02)
    assert_allclose(psm.setpoint[:6], DEEP, atol=1e-9)  # as fast as a servo_jp
    psm.say("/PSM1/servo_js", JointServo(name=("outer_pitch",), velocity=[0.2], mode=(V,)), 0.2)
    assert_allclose(psm.setpoint[:3], [0.0, 0.02, 0.12], atol=3e-4)
    assert not psm.refusals


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (JointServo(position=DEEP, effort=np.zeros(6), mode=(PVF,) * 6), "efforts with positions"),
        (JointServo(position=DEEP, velocity=np.zeros(6), mode=(P, V, P, P, P, P)), "the arm takes one kind"),
        (JointServo(position=DEEP, mode=(P,) * 5), "5 modes, expected 6"),
        (JointServo(position=DEEP[:4], mode=(P,) * 6), "JointServo.position"),
        (JointServo(position=DEEP + 1.0), "from its setpoint"),
        (JointServo(position=[np.nan, *DEEP[1:]]), "JointServo.position"),
    ],
)
def test_what_a_servo_js_cannot_mean_is_refused_and_moves_nothing(psm, message, said: str):
    psm.joints("move_jp", DEEP)
    psm.wait()
    psm.say("/PSM1/servo_js", message, 0.05)
    assert_array_equal(psm.setpoint[:6], DEEP)
    (refused,) = psm.refusals
    assert said in refused


def test_efforts_of_a_servo_js_push(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    for _ in range(10):
        psm.say("/PSM1/servo_js", JointServo(effort=[0.0, 0.0, 2.0, 0.0, 0.0, 0.0], mode=(F,) * 6))
    assert psm.plant.measured_js().q[2] > 0.121


def test_a_pose_with_a_twist_and_a_twist_alone_move_the_tool(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    start, measured = (pose_of(psm.last(f"/PSM1/{name}_cp")) for name in ("setpoint", "measured"))
    told = psm.last("/PSM1/measured_cs")
    assert all(one.data for one in (told.pose_is_valid, told.twist_is_valid, told.wrench_is_valid))
    assert_allclose(tuple(told.pose.position), measured.position, atol=1e-5)
    step = np.array([0.002, 0.0, 0.0])
    goal = pose_message(Pose(start.rotation, start.position + step), 0, "base").pose
    linear = message_class("geometry_msgs/Vector3")(0.01, 0.0, 0.0)
    both = CartesianState(pose=goal, pose_is_valid=Bool(True), twist_is_valid=Bool(True))
    both = both._replace(twist=both.twist._replace(linear=linear))
    psm.say("/PSM1/servo_cs", both, 0.05)
    moved = pose_of(psm.last("/PSM1/setpoint_cp")).position - start.position
    assert 0.0003 < moved[0] < 0.0019
    for _ in range(20):
        psm.say("/PSM1/servo_cs", both, 0.02)
    assert_allclose(pose_of(psm.last("/PSM1/setpoint_cp")).position - start.position, step, atol=1e-5)
    psm.say("/PSM1/servo_cs", both._replace(pose_is_valid=Bool(False)), 0.3)
    there = pose_of(psm.last("/PSM1/setpoint_cp")).position - start.position
    assert_allclose(there, step + np.array([0.001, 0.0, 0.0]), atol=5e-5)
    psm.say("/PSM1/servo_cs", both._replace(wrench_is_valid=Bool(True)))
    (refused,) = psm.refusals
    assert "a wrench with a pose" in refused


def test_after_torques_have_wound_its_roll_up_a_move_cp_goes_back_in_seconds(psm):
    psm.joints("move_jp", DEEP)
    psm.wait()
    start = psm.last("/PSM1/setpoint_cp")
    for _ in range(50):
        psm.say("/PSM1/servo_jf", JointState(effort=np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0])))
    assert psm.plant.measured_js().q[3] > 3.0
    psm.say("/PSM1/move_cp", pose_message(pose_of(start), 0, "base"))
    assert psm.wait() < 10.0
    assert_allclose(pose_of(psm.last("/PSM1/setpoint_cp")).position, pose_of(start).position, atol=1e-5)
    assert not psm.refusals


def test_statistics_of_ticks_come_once_a_second(psm):
    heard = psm.hear("/PSM1/period_statistics")
    psm.sleep(3.1)
    told = [one.message for one in heard.take()]
    assert len(told) == 3
    assert told[-1].period_avg == pytest.approx(0.001)
    assert told[-1].number_of_samples == 1000
    assert 0.0 < told[-1].compute_time_min <= told[-1].compute_time_avg <= told[-1].compute_time_max


def test_error_tells_why_an_arm_is_in_fault(psm):
    heard = psm.hear("/PSM1/error")
    psm.plant._set_state("FAULT", "a cable is slack")
    psm.sleep(0.1)
    (told,) = [one.message.data for one in heard.take()]
    assert told == "PSM1: FAULT: a cable is slack"
