"""What a server does about old commands, faults of the network and of the robot, in either dialect."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient, press_button
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import command_message
from catenary.crtk.reader import CrtkReader
from catenary.crtk.topic_names import BUTTON, BUTTON_TYPE, DIAGNOSTICS, DIAGNOSTICS_TYPE, find_topic
from catenary.errors import InputError, NotReadyError, TransportError, UnsupportedCommandError
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.plant import OperatingState
from catenary.raven2.topics import EXT_JPOS, JOINT_ENC
from catenary.simulation.cable_plant import CablePlant
from catenary.topics import SECOND
from oracles.cable_arms import homed_plant
from oracles.ticking_clock import BEGIN, SetClock
from served_robot import JointState, ServedRobot, answered, homing_plant, shoulder


def living_client(state: str, command: str, *, dialect: str = "raven", stamp: int = 0) -> ServedRobot:
    """A robot that starts on a network where a client has latched a command of its own."""
    network = LoopbackNetwork(clock=SetClock(BEGIN))
    client = Loopback("client", network)
    publisher = client.publisher("/arm1/state_command", "crtk_msgs/StringStamped", latch=True)
    publisher.publish(command_message(command, stamp))
    plant = homed_plant("left")
    plant.state_command({"PAUSED": "pause", "DISABLED": "disable"}[state])
    robot = ServedRobot(dialect, network=network, plant=plant)
    robot._publishers["/arm1/state_command"] = publisher
    return robot


@pytest.mark.parametrize(
    ("state", "latched", "stamp", "dialect"),
    [
        ("PAUSED", "resume", 0, "raven"),
        ("PAUSED", "resume", BEGIN - SECOND // 10, "raven"),
        ("PAUSED", "resume", BEGIN - 100 * SECOND, "raven"),
        ("DISABLED", "enable", 0, "crtk"),
    ],
)
def test_a_latched_command_of_a_client_enables_no_restarted_robot(state, latched, stamp, dialect):
    robot = living_client(state, latched, dialect=dialect, stamp=stamp)
    robot.tick(3000)
    assert robot.state() == state
    assert sum(report.count for report in robot.server.reports.kinds.values()) == 1


@pytest.mark.parametrize(("ticks", "stamped"), [(1200, False), (10, True)])
def test_the_same_client_is_obeyed_a_second_later_or_with_a_stamp(ticks, stamped):
    robot = living_client("PAUSED", "resume")
    robot.tick(ticks)
    robot.command("resume", stamp=robot.clock.now() if stamped else 0)
    robot.tick()
    assert robot.state() == "ENABLED"


def test_disable_is_obeyed_however_old():
    robot = living_client("PAUSED", "disable", stamp=BEGIN - 100 * SECOND)
    robot.tick(2)
    assert robot.state() == "DISABLED"


@pytest.mark.parametrize(("age", "moved"), [(0.0, 1e-3), (0.4, 1e-3), (0.6, 0.0), (3600.0, 0.0)])
def test_stamped_commands_older_than_half_a_second_are_not_obeyed(age, moved):
    robot = ServedRobot()
    before = robot.setpoint
    robot.tick(10)
    stamp = robot.clock.now() - round(age * SECOND)
    robot.say("servo_jr", JointState(header=header(stamp), position=shoulder(1e-3)))
    robot.tick(3)
    assert_allclose(robot.setpoint - before, shoulder(moved), atol=1e-12)


def test_a_network_that_stalls_for_a_second_delays_a_motion_and_nothing_leaps():
    robot = ServedRobot()
    before = robot.setpoint
    for _ in range(100):
        robot.joints("servo_jr", shoulder(1e-4))
        robot.tick()
    robot.tick(5)
    stalled = robot.setpoint
    assert_allclose(stalled - before, shoulder(0.01), atol=1e-12)
    robot.tick(1000)
    assert_array_equal(robot.setpoint, stalled)
    for _ in range(500):  # what the client had sent meanwhile comes at once
        robot.joints("servo_jr", shoulder(1e-4))
    fastest = 0.0
    for _ in range(300):
        last = robot.setpoint
        robot.tick()
        fastest = max(fastest, np.abs(robot.setpoint - last).max())
    assert_allclose(robot.setpoint - before, shoulder(0.06), atol=1e-12)
    assert fastest <= 4.001e-4  # four messages a millisecond


def test_trouble_of_one_kind_is_logged_once_in_five_seconds_and_counted(caplog):
    robot = ServedRobot()
    for _ in range(400):
        robot.joints("servo_jr", np.full(7, np.nan))
        robot.tick()
    assert robot.server.reports.kinds["/arm1/servo_jr: refused"].count == 400
    assert len([one for one in caplog.records if "servo_jr" in one.message]) == 1


def press_the_silver_button(robot: ServedRobot) -> None:
    assert answered(robot.server, BUTTON, BUTTON_TYPE).success


def enable_and_home(robot: ServedRobot) -> None:
    for command in ("enable", "home"):
        robot.tick()
        robot.command(command)


@pytest.mark.parametrize(
    ("dialect", "start", "states"),
    [
        ("raven", press_the_silver_button, [("ENABLED", False, True), ("PAUSED", True, False)]),
        (
            "crtk",
            enable_and_home,
            [("DISABLED", False, False), ("ENABLED", False, False), ("ENABLED", False, True), ("ENABLED", True, False)],
        ),
    ],
)
def test_homing_is_busy_and_leaves_the_pedal_up_or_the_arm_enabled(dialect, start, states):
    robot = ServedRobot(dialect, plant=homing_plant())
    assert robot.state() == "DISABLED"
    heard = robot.hear("operating_state")
    start(robot)
    robot.tick(300)
    seen = [(one.message.state, one.message.is_homed, one.message.is_busy) for one in heard.take()]
    assert list(dict.fromkeys(seen)) == states


def test_homing_that_fails_leaves_a_fault_and_a_living_server():
    class Stuck(CablePlant):
        def wait(self) -> None:
            if self.operating_state().is_busy:
                self._set_state("FAULT")
                raise NotReadyError("homing: shoulder met no stop in 60 s")
            super().wait()

    robot = ServedRobot(plant=Stuck())
    robot.server.press_button()
    robot.tick(10)
    assert robot.state() == "FAULT"
    assert "met no stop" in robot.server.reports.kinds["gold: fault"].text


def test_a_published_rate_is_a_part_of_the_robots():
    network = LoopbackNetwork(clock=SetClock(BEGIN))
    server = make_server(Serving(), Loopback("robot", network), rate_hz=200.0)
    heard = Loopback("client", network).subscribe("/arm1/setpoint_js", "sensor_msgs/JointState")
    for _ in range(100):
        server.tick()
    assert len(heard.take()) == 20


def test_a_topic_that_carries_another_type_is_refused():
    network = LoopbackNetwork()
    Loopback("client", network).publisher("/arm1/servo_jr", "std_msgs/Empty")
    with pytest.raises(TransportError, match="servo_jr"):
        make_server(Serving(), Loopback("robot", network))


def test_who_asks_for_a_state_hears_the_robot_in_the_same_tick():
    robot = ServedRobot()
    robot.tick(200)
    heard = [robot.hear(verb) for verb in ("measured_js", "setpoint_js", "setpoint_cp")]
    robot.command("pause")
    robot.tick()
    assert [len(one) for one in heard] == [1, 1, 1]


def test_clients_are_known_by_name():
    robot = ServedRobot()
    robot.joints("servo_jr", np.zeros(7))
    assert robot.server.clients() == {"client"}


def test_nothing_but_states_for_who_may_come_is_made_while_nobody_listens():
    robot = ServedRobot()
    heard = robot.client.subscribe("/ravenstate", "raven_2/raven_state")
    robot.tick(200)
    publishers = robot.server.publishers.values()
    assert [lazy.topic.verb for lazy in publishers if lazy.heard] == ["ravenstate"]
    sent = {lazy.topic.name: lazy.publisher._sent for lazy in publishers}
    assert len(heard.take()) == 200
    robot.tick(200)
    more = {one.topic.name: one.publisher._sent - sent[one.topic.name] for one in publishers}
    assert more.pop("/ravenstate") == 200
    states = [count for name, count in more.items() if name.endswith("operating_state")]
    assert all(count <= 10 for count in states)  # some forty a second, for who may come
    assert sum(more.values()) == sum(states)
    assert len(heard.take()) == 200
    heard.close()
    heard = robot.hear("measured_js")  # whoever comes later is found within a tick for each topic
    robot.tick(200)
    assert 160 <= len(heard.take()) <= 200


@pytest.mark.parametrize("by", [-3600, 3600])
def test_stamps_of_a_server_follow_its_clock_and_commands_are_obeyed_on(by: int, caplog) -> None:
    robot = ServedRobot()
    heard = [robot.hear(verb) for verb in ("setpoint_js", "measured_js")]
    diagnostics = robot.client.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    robot.tick(1200)
    robot.clock.ahead = by * SECOND
    robot.tick(1200)
    for topic in (*heard, diagnostics):
        stamp = topic.take()[-1].message.header.stamp
        assert 0 <= robot.clock.now() - stamp <= 1.1 * SECOND, topic.topic  # /diagnostics come once a second
    robot.command("pause", stamp=robot.clock.now())
    robot.tick(10)
    assert robot.state() == "PAUSED"
    robot.command("resume", stamp=robot.clock.now())
    robot.tick(10)
    assert robot.state() == "ENABLED"
    assert [record.getMessage() for record in caplog.records] == [
        f"the clock was set by {by:+}.000 s; stamps follow it"
    ]


def test_what_was_latched_before_a_server_began_is_not_obeyed_where_the_clock_is_set_back_then() -> None:
    network = LoopbackNetwork(clock=SetClock())
    topic = find_topic("raven", "state_command", "gold")
    publisher = Loopback("client", network).publisher(topic.name, topic.type, latch=True)
    publisher.publish(command_message("resume", 0))
    robot = ServedRobot(state="PAUSED", network=network)
    robot.clock.ahead = -10 * SECOND
    robot.tick()
    publisher.publish(command_message("resume", 0))  # likewise of unknown age
    robot.tick(300)
    assert robot.state() == "PAUSED"


WHY = "the software e-stop tripped: a motor's command was too large"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_fault_is_told_with_its_reason(dialect):
    robot = ServedRobot(dialect)
    heard, told = robot.client.subscribe(DIAGNOSTICS, DIAGNOSTICS_TYPE), robot.hear("warning")
    robot.tick(5)
    (ok,) = heard.take()[-1].message.status
    assert (ok.level, ok.message, ok.hardware_id) == (0, "ENABLED", "/arm1")
    robot.plant._set_state("FAULT", WHY)
    robot.tick(5)
    (fault,) = heard.take()[-1].message.status
    assert (fault.level, fault.message) == (2, f"FAULT: {WHY}")
    assert f"gold: FAULT: {WHY}" in [one.message.data for one in told.take()]
    before = len(heard.take())
    robot.tick(500)
    assert len(heard.take()) == before == 0  # once a second
    robot.tick(600)
    assert len(heard.take()) == 1


def test_who_wants_to_move_it_is_told():
    robot = ServedRobot("crtk")
    robot.tick_while_slept()
    client = CrtkClient(Loopback("mine", robot.network), dialect="crtk")
    assert client.fault_reason == ""
    robot.plant._set_state("FAULT", WHY)
    client.wait()
    with pytest.raises(NotReadyError, match=rf"the robot is FAULT \({WHY}\), expected ENABLED"):
        client.servo_jr(shoulder(1e-3))
    assert CrtkReader(Loopback("other", robot.network), dialect="crtk").fault_reason == WHY
    client.state_command("disable")
    assert client.fault_reason == ""
    client.state_command("enable")


def hear(robot, topic):
    return robot.client.subscribe(topic.name, topic.type, depth=10_000)


def positions(subscription):
    return np.array([message.position for message, _ in subscription.take()])


@pytest.fixture(scope="module")
def robot():
    return ServedRobot()


def test_both_topics_come_a_hundred_times_a_second(robot):
    heard = [hear(robot, topic) for topic in (EXT_JPOS, JOINT_ENC)]
    robot.tick(1150)
    for one in heard:
        stamps = [message.header.stamp for message, _ in one.take()][-100:]
        assert_allclose(np.diff(stamps), 1e7)
        one.close()


def test_they_move_as_the_joints_do_and_not_as_the_robot_believes(robot):
    robot.tick(1000)  # its cables have settled
    counts, read = hear(robot, JOINT_ENC), hear(robot, EXT_JPOS)
    robot.tick(130)
    begin, believed = robot.plant.telemetry()["q_true"], robot.plant.measured_js().q[:3]
    for share in np.sin(np.linspace(0.0, np.pi, 400)) ** 2:  # a motor that is stopped short trips the e-stop
        robot.joints("servo_jr", share * np.array([2e-3, 1e-3, 2e-5, 0, 0, 0, 0]))
        robot.tick()
    robot.tick(1000)  # at rest
    assert robot.state() == "ENABLED"
    true = robot.plant.telemetry()["q_true"] - begin
    believed = robot.plant.measured_js().q[:3] - believed
    c, q = positions(counts), positions(read)
    moved = q[-1] - q[0]
    assert (np.abs(moved) > [0.2, 0.1, 5e-4]).all()  # they do move
    resolution = 1.0 / robot.plant.encoders.rig.counts
    assert (np.abs(moved - true) < 3.0 * resolution + 1e-3 * np.abs(true)).all()
    assert (np.abs(believed - true) > np.abs(moved - true)).all()
    assert (c == np.rint(c)).all()
    assert_allclose((c[-1] - c[0]) * resolution, moved, rtol=1e-9)
    counts.close()
    read.close()


def test_an_arm_that_is_not_homed_has_counts_and_no_positions():
    robot = ServedRobot(plant=CablePlant(side="left"))
    counts, read = hear(robot, JOINT_ENC), hear(robot, EXT_JPOS)
    robot.tick(200)
    assert len(positions(counts)) > 5
    assert len(positions(read)) == 0
    assert EXT_JPOS.name in robot.client.topics()  # whoever waits for the encoders' program sees it run


def test_the_present_convention_knows_no_such_topics():
    robot = ServedRobot("crtk")
    robot.tick(5)
    assert EXT_JPOS.name not in robot.client.topics()


NAN, INF, START = np.nan, np.inf, [0.5, 1.2, 0.4, 0.0, 0.1, 0.2, -0.2]
PoseStamped, Pose, Point, Quaternion, WrenchStamped, Wrench, Vector3 = (
    message_class(f"geometry_msgs/{name}")
    for name in ("PoseStamped", "Pose", "Point", "Quaternion", "WrenchStamped", "Wrench", "Vector3")
)


def spoilt(value: float) -> list[float]:
    return [*START[:2], value, *START[3:]]


OF_CRTK = [
    *(
        ("crtk", verb, JointState(**{field: values}), reason)
        for verb, field in (
            ("servo_jp", "position"),
            ("move_jp", "position"),
            ("servo_jv", "velocity"),
            ("servo_jf", "effort"),
        )
        for values, reason in (
            (spoilt(NAN), "nan"),
            (spoilt(INF), "inf"),
            ([], f"0 numbers in `{field}`"),
            (START[:3], f"3 numbers in `{field}`, expected 7"),
            ([*START, 0.0], f"8 numbers in `{field}`, expected 7"),
        )
    ),
    *(
        ("crtk", verb, JointState(name=names, position=START), reason)
        for verb in ("servo_jp", "move_jp")
        for names, reason in ((("shoulder",), "7 numbers for 1 names"), (tuple("abcdefg"), "unknown: a"))
    ),
    ("crtk", "move_jp", JointState(position=[3.5, *START[1:]]), "outside [0"),
    *(
        ("crtk", "servo_cf", WrenchStamped(wrench=Wrench(Vector3(one))), text)
        for one, text in ((NAN, "nan"), (INF, "inf"))
    ),
    *(
        ("crtk", verb, PoseStamped(pose=pose), reason)
        for verb in ("servo_cp", "move_cp")
        for pose, reason in (
            (Pose(Point(NAN, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)), "nan"),
            (Pose(orientation=Quaternion(0.0, 0.0, 0.0, 0.0)), "expected length 1"),
            (Pose(orientation=Quaternion(NAN, 0.0, 0.0, 1.0)), "nan"),
            (Pose(Point(5.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)), "from the"),  # the base, or the setpoint
        )
    ),
]
# of an increment with more than seven numbers the first seven count, and a single one is the grasp's
OF_RAVEN = [
    *(("raven", "servo_jr", JointState(position=values), "") for values in (spoilt(NAN), spoilt(INF), START[:6], [])),
    *(("raven", "servo_jp", JointState(position=np.full(length, 0.5)), "") for length in (2, 6, 8, 15)),
    ("raven", "servo_jr", JointState(name=tuple("abcdefg"), position=START), "unknown: a"),
]


@pytest.mark.parametrize("dialect", ["crtk", "raven"])
def test_commands_that_make_no_sense_move_nothing_and_the_arm_says_why(dialect) -> None:
    for spoken, verb, message, reason in OF_CRTK + OF_RAVEN:
        if spoken != dialect:
            continue
        robot = ServedRobot(dialect)
        before, told = robot.setpoint, robot.hear("warning")
        robot.say(verb, message)
        robot.tick(5)
        assert_array_equal(robot.setpoint, before)
        assert robot.server.reports.kinds[f"/arm1/{verb}: refused"].count == 1
        (said,) = (one.message.data for one in told.take())
        assert said.startswith(f"/arm1/{verb}: refused: ")
        assert reason in said
        assert robot.state() == "ENABLED"


def test_a_parked_arm_stays_disabled_where_it_was_put_and_obeys_nothing():
    arm = ParkedArm(("a", "b"), ("rad", "m"), [0.5, 0.1])
    arm.wait()
    arm.measured_js().q[:] = 9.0  # the receiver's own
    for state in (arm.measured_js(), arm.setpoint_js()):
        assert_array_equal(state.q, [0.5, 0.1])
    assert arm.operating_state() == OperatingState("DISABLED", False, False)
    for command in (lambda: arm.servo_jp(np.zeros(2)), lambda: arm.state_command("enable")):
        with pytest.raises(UnsupportedCommandError, match="parked"):
            command()
    with pytest.raises(InputError):
        ParkedArm(("a", "b"), ("rad", "m"), [0.5])


def test_ticks_that_are_made_up_for_at_once_are_stamped_as_they_were_due() -> None:
    robot = ServedRobot()
    heard = [robot.hear(verb) for verb in ("setpoint_js", "measured_js")]
    robot.tick(1200)
    for topic in heard:
        topic.take()
    robot.clock.sleep(0.02)
    for late in range(20, 0, -1):  # the clock stands meanwhile
        robot.server.tick(late=1e-3 * late)
    for topic in heard:
        assert np.diff([one.message.header.stamp for one in topic.take()]).tolist() == pytest.approx(
            [1e6] * 19, abs=2
        )  # one is 1 ns behind the last


def test_it_starts_the_robot_and_says_what_it_did() -> None:
    robot = ServedRobot(plant=homing_plant())
    robot.tick_while_slept()
    robot.clock.sleep(0.2)  # it looks ten times a second at who is there
    assert press_button(robot.client) == (True, "gold: starts")
    robot.clock.sleep(0.05)
    assert robot.plant.operating_state().is_busy
    success, said = press_button(robot.client)
    assert not success
    assert said == "gold: the arm is ENABLED already"


def test_where_nobody_has_one_it_says_so() -> None:
    lonely = Loopback("client", LoopbackNetwork(clock=SetClock()))
    with pytest.raises(TransportError, match="nobody listens"):
        press_button(lonely)
