"""Ros1Transport between processes; what holds for every transport is in contracts, rospy's own classes in test_ros1_rospy."""

import contextlib
import os
import signal
import socket
import time
import xmlrpc.client
from collections.abc import Iterator
from pathlib import Path

import pytest

from patience import PATIENCE, until
from ros import OPEN, Master, Program, running_master

pytestmark = pytest.mark.slow

# publishes 1, 2, 3, ... until a line comes; then says how many it has sent, and what slow peers missed. Meanwhile it says
# what it was asked to tell: that the master comes and goes, or that a peer has begun to miss messages
TALKER = (
    OPEN
    + """
import threading
publisher = transport.publisher("/count", T, queue=int(sys.argv[2]))
while not transport.connections("/count").subscribers:
    time.sleep(0.01)
end = threading.Event()
threading.Thread(target=lambda: (sys.stdin.readline(), end.set()), daemon=True).start()
print("connected")
rate, sent, last = transport.rate(1000.0), 0, None
pad = "x" * int(sys.argv[3])
tell = {"": lambda: None, "master": transport.is_up, "overflow": lambda: publisher.overflowed > 0}[sys.argv[4]]
while not end.is_set():
    sent += 1
    publisher.publish(message_class(T)(header(transport.now()), f"{sent} {pad}"))
    if tell() != last:
        last = tell()
        print(sys.argv[4], last, sent)
    rate.sleep()
print(sent, publisher.overflowed, *publisher.missed)
sys.stdin.readline()
"""
)
# says what has come: whenever a line comes, the numbers since the last
LISTENER = f"""{OPEN}
subscription = transport.subscribe("/count", T, depth=100_000)
print("listening")
while sys.stdin.readline():
    print(*(one.message.string.split()[0] for one in subscription.take()))
"""


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    """One for all tests that leave it alone."""
    with running_master(tmp_path_factory.mktemp("ros")) as running:
        yield running


@pytest.fixture
def own_master(tmp_path: Path) -> Iterator[Master]:
    """One of the test's own, which it may kill."""
    with running_master(tmp_path) as running:
        yield running


def numbers(listener: Program) -> list[int]:
    listener.say("more")
    return [int(word) for word in listener.line().split()]


def hear_to(last: int, listener: Program, came: list[int]) -> None:
    """Add what comes until that number, or a later one, has come."""
    until(lambda: (came and came[-1] >= last) or came.extend(numbers(listener)), every=0.05)


def test_a_master_that_dies_is_noticed_and_loses_no_message(own_master: Master) -> None:
    with Program(own_master, LISTENER, "listener") as listener:
        assert listener.line() == "listening"
        with Program(own_master, TALKER, "talker", "10000", "10", "master") as talker:
            assert talker.line() == "connected"
            assert talker.line().startswith("master True")
            own_master.kill()
            assert talker.line().startswith("master False")
            own_master.start()
            *told, sent = talker.line().split()
            assert told == ["master", "True"]
            came: list[int] = []
            hear_to(int(sent) + 100, listener, came)
            talker.say("end")
            sent = int(talker.line().split()[0])
            hear_to(sent, listener, came)
            assert came == list(range(1, sent + 1))


def test_a_returned_master_knows_topics_and_services_again(own_master: Master) -> None:
    code = f"""{OPEN}
from patience import polled
response = message_class("std_srvs/TriggerResponse")
transport.service("/button", "std_srvs/Trigger", lambda request: response(success=True))
heard = transport.subscribe("/count", T)
said = transport.publisher("/said", T, latch=True)
said.publish(message_class(T)(string="before"))
with polled(transport):
    print("up")
    while transport.is_up(): time.sleep(0.01)
    print("down")
    while not transport.is_up(): time.sleep(0.01)
    print("up again")
    got = []
    while not got: got = heard.take(0.1)
    print(got[0].message.string.split()[0])
    sys.stdin.readline()
"""
    with Program(own_master, code, "robot") as robot:
        assert robot.line() == "up"
        own_master.kill()
        assert robot.line() == "down"
        own_master.start()
        assert robot.line() == "up again"
        # a program that comes only now finds the robot, and the robot finds it
        with Program(own_master, TALKER, "talker", "100", "10", "") as talker:
            assert talker.line() == "connected"
            assert int(robot.line()) >= 1
        client = f"""{OPEN}
heard = transport.subscribe("/said", T)
print(heard.take(PATIENCE)[0].message.string)
print(transport.node.master.service_answers("/button"))
"""
        with Program(own_master, client, "client") as late:
            assert late.line() == "before"
            assert late.line() == "True"


def test_a_peer_that_stands_still_delays_nobody_and_gets_whole_messages_afterwards(master: Master) -> None:
    with Program(master, LISTENER, "stalled") as stalled, Program(master, LISTENER, "listener") as listener:
        assert stalled.line() == listener.line() == "listening"
        # 10 kB a message: the system's sockets are soon full
        with Program(master, TALKER, "talker", "50", "10000", "overflow") as talker:
            assert talker.line() == "connected"
            assert talker.line().startswith("overflow False")
            whole: list[int] = []
            broken: list[int] = []
            hear_to(1, listener, whole)
            hear_to(1, stalled, broken)
            with stalled.standing_still():
                *told, sent = talker.line().split()  # whoever waited for that peer would not come to say it
                assert told == ["overflow", "True"]
                hear_to(int(sent) + 100, listener, whole)
            talker.say("end")
            *counts, name = talker.line().split()[:3]
            sent, overflowed = map(int, counts)
            hear_to(sent, listener, whole)
            hear_to(sent, stalled, broken)
            assert broken == sorted(set(broken))
            assert broken[-1] == sent
            # both peers' misses are counted; the quick one's, too, where the machine let it wait
            missed = sum(sent - came[0] + 1 - len(came) for came in (whole, broken))
            assert missed == overflowed > 0
            assert name in ("/stalled", "/listener")
            assert whole == sorted(set(whole))


def test_a_peer_that_dies_ends_for_itself_alone(master: Master) -> None:
    with Program(master, LISTENER, "dying") as dying, Program(master, LISTENER, "living") as living:
        assert dying.line() == living.line() == "listening"
        with Program(master, TALKER, "talker", "10000", "10", "") as talker:
            assert talker.line() == "connected"
            hear_to(1, dying, [])
            dying.process.kill()
            with Program(master, LISTENER, "dying") as back:
                assert back.line() == "listening"
                here: list[int] = []
                again: list[int] = []
                hear_to(1, back, again)
                talker.say("end")
                sent = int(talker.line().split()[0])
                hear_to(sent, living, here)
                hear_to(sent, back, again)
                for came in (here, again):
                    assert came == list(range(came[0], sent + 1))


def port_of(topic: str, node: str, master: Master) -> int:
    """Port at which a node takes subscribers of a topic, once it publishes it."""
    found: list[int] = []

    def ask() -> object:
        with xmlrpc.client.ServerProxy(master.uri) as server:
            code, _, uri = server.lookupNode("/tests", node)  # type: ignore[misc]
        if code == 1:
            with xmlrpc.client.ServerProxy(str(uri)) as publisher:
                code, _, answer = publisher.requestTopic("/tests", topic, [["TCPROS"]])  # type: ignore[misc]
            found.extend(answer[2:] if code == 1 else ())  # type: ignore[index]
        return found

    until(ask, every=0.05)
    return found[0]


def test_a_peer_that_says_nothing_keeps_no_other_out(master: Master) -> None:
    with (
        Program(master, TALKER, "asked", "100", "10", "") as talker,
        socket.create_connection(("127.0.0.1", port_of("/count", "/asked", master))),
    ):
        begin = time.monotonic()
        with Program(master, LISTENER, "listener"):
            assert talker.line() == "connected"
        assert time.monotonic() - begin < 60.0  # [s] after which rospy gives the silent one up


def test_a_name_that_runs_already_is_refused_and_goes_on_and_is_free_after_a_crash(master: Master) -> None:
    with Program(master, LISTENER, "robot") as first:
        assert first.line() == "listening"
        with Program(master, OPEN, "robot") as second:
            errors = second.finish()[1]
        assert "a node /robot runs already" in errors
        assert numbers(first) == []
        first.process.kill()
        first.process.wait()
    with Program(master, LISTENER, "robot") as third:
        assert third.line() == "listening"


def test_what_a_crash_left_behind_does_not_stop_another_program(master: Master) -> None:
    code = f"""{OPEN}
transport.publisher("/left", sys.argv[2])
transport.service("/left_service", "std_srvs/Trigger", lambda request: request)
print("up")
sys.stdin.readline()
"""
    with Program(master, code, "crashing", "std_msgs/String") as first:
        assert first.line() == "up"
        with Program(master, code, "other", "std_msgs/Bool") as second:
            assert "/left carries std_msgs/String, expected std_msgs/Bool" in second.finish()[1]
        first.process.kill()
        first.process.wait()
    with Program(master, code, "other", "std_msgs/Bool") as third:
        assert third.line() == "up"


def test_the_environments_namespace_and_the_programs_arguments_change_no_name(master: Master) -> None:
    code = OPEN + 'transport.publisher("ravenstate_100hz", T)\nprint(*transport.topics())\nsys.stdin.readline()\n'
    with Program(master, code, "robot", "ravenstate_100hz:=/other", "__name:=other", ROS_NAMESPACE="ward") as robot:
        assert "/ravenstate_100hz" in robot.line().split()
        with xmlrpc.client.ServerProxy(master.uri) as server:
            assert server.lookupNode("/tests", "/ward/robot")[0] == 1  # type: ignore[index]


def test_programs_end_by_themselves_by_ctrl_c_and_by_rosnode_and_leave_nothing(own_master, tmp_path) -> None:
    before = set(tmp_path.rglob("*"))
    with Program(own_master, OPEN + 'transport.publisher("/x", T)\n', "robot") as robot:
        assert robot.finish() == ("", "")
    sleeping = f"""{OPEN}
try:
    print("sleeping")
    time.sleep(PATIENCE)
except KeyboardInterrupt:
    print("interrupted", transport.is_up())
"""
    with Program(own_master, sleeping, "robot") as robot:
        assert robot.line() == "sleeping"
        robot.interrupt()
        assert robot.line() == "interrupted True"
        robot.finish()
        assert robot.process.returncode == 0
    with Program(
        own_master, OPEN + 'print("spinning")\nwhile transport.is_up():\n    time.sleep(0.01)\nprint("done")\n', "robot"
    ) as robot:
        assert robot.line() == "spinning"
        with xmlrpc.client.ServerProxy(own_master.uri) as server:
            uri = server.lookupNode("/tests", "/robot")[2]  # type: ignore[index]
        # it may end before it answers
        with xmlrpc.client.ServerProxy(str(uri)) as node, contextlib.suppress(OSError):
            node.shutdown("/tests", "rosnode kill")
        assert "done" in robot.finish()[0]
    with xmlrpc.client.ServerProxy(own_master.uri) as server:
        assert server.getSystemState("/tests")[2] == [[], [], []]  # type: ignore[index]
    assert set(tmp_path.rglob("*")) == before


def test_ctrl_c_is_heeded_while_a_topic_ends_and_a_master_that_stands_still_keeps_no_program(own_master) -> None:
    code = f"""{OPEN}
import _thread, threading
heard = transport.subscribe("/count", T)
print("up")
sys.stdin.readline()
threading.Timer(0.5, _thread.interrupt_main).start()
try:
    heard.close()
    print("the Ctrl-C was lost")
except KeyboardInterrupt:
    print("interrupted")
"""
    with Program(own_master, code, "node") as node:
        assert node.line() == "up"
        assert own_master._process is not None
        os.kill(own_master._process.pid, signal.SIGSTOP)
        node.say("go")
        assert node.line() == "interrupted"
        node.finish(PATIENCE)
        assert node.process.returncode == 0
