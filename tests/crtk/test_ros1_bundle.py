"""Frames sent into many sockets at once: what becomes of slow, ended and late peers, and of other users of a socket."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from patience import until
from ros import Master, Program, running_master

pytestmark = pytest.mark.slow

OPEN = """
import sys, time, threading
import numpy as np
from patience import PATIENCE
from catenary.crtk.frames import joint_state_frame, frame_of, Frame
from catenary.crtk.message import header, message_class
from catenary.crtk.ros1 import Ros1Transport
from catenary.crtk.sheet import Sheet
STATE, JS = "crtk_msgs/OperatingState", "sensor_msgs/JointState"
transport = Ros1Transport(sys.argv[1])
"""
# one topic that somebody hears
HEARD = (
    OPEN
    + """
publisher = transport.publisher("/t0", JS)
sheet = Sheet([joint_state_frame(("a",), 0, 0)], 1)
bundle = transport.bundle([publisher], sheet)
sheet.heard[:] = True
while not transport.connections("/t0").subscribers:
    time.sleep(0.01)
"""
)
# sends a number that grows on many topics, until a line comes; then says how many it sent and what slow peers missed.
# Meanwhile it says when a peer begins to miss messages
TALKER = (
    OPEN
    + """
topics, size, queue = int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
publishers = [transport.publisher(f"/t{k}", JS, queue=queue) for k in range(topics)]
names = tuple(f"{k:04}" for k in range(size))
sheet = Sheet([joint_state_frame(names, 0, 0) for _ in range(topics)], size)
bundle = transport.bundle(publishers, sheet)
sheet.write(0)  # nobody hears it: this compiles
bundle.send()
sheet.heard[:] = True
while not all(transport.connections(f"/t{k}").subscribers for k in range(topics)):
    time.sleep(0.01)
lines = []
threading.Thread(target=lambda: lines.append(sys.stdin.readline()), daemon=True).start()
print("connected")
rate, sent, told = transport.rate(1000.0), 0, False
def missed():
    return sum(one.overflowed for one in publishers)
while not lines:
    sent += 1
    sheet.numbers[:] = sent
    sheet.write(transport.now())
    bundle.send()
    if not told and missed():
        told = True
        print("overflow", sent)
    rate.sleep()
print(sent, missed())
sys.stdin.readline()
"""
)
# says what has come on each topic since the last time, whenever a line comes: numbers, and whether any was torn
LISTENER = (
    OPEN
    + """
heard = [transport.subscribe(f"/t{k}", JS, depth=100_000) for k in range(int(sys.argv[2]))]
print("listening")
while sys.stdin.readline():
    for one in heard:
        got = [m for m, _ in one.take()]
        whole = all((m.position == m.position[0]).all() and m.effort[-1] == m.position[0] for m in got)
        print(whole and not one.damaged, *(int(m.position[0]) for m in got))
"""
)


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    with running_master(tmp_path_factory.mktemp("ros")) as running:
        yield running


def heard(listener: Program, topics: int) -> list[list[int]]:
    """Numbers by topic; none was torn."""
    listener.say("more")
    rows = [listener.line().split() for _ in range(topics)]
    assert [row[0] for row in rows] == ["True"] * topics
    return [list(map(int, row[1:])) for row in rows]


def hear_to(last: int, listener: Program, came: list[list[int]]) -> None:
    """Add what comes until that number, or a later one, has come on every topic."""

    def is_there() -> bool:
        if all(numbers and numbers[-1] >= last for numbers in came):
            return True
        for numbers, more in zip(came, heard(listener, len(came)), strict=True):
            numbers += more
        return False

    until(is_there, every=0.05)


def test_every_message_of_every_topic_arrives_whole_and_in_order(master: Master) -> None:
    with Program(master, LISTENER, "listener", "5") as listener:
        assert listener.line() == "listening"
        # a machine on which the listener stands still for seconds is not what this is about
        with Program(master, TALKER, "talker", "5", "7", "10000") as talker:
            assert talker.line() == "connected"
            came: list[list[int]] = [[] for _ in range(5)]
            hear_to(1000, listener, came)
            talker.say("end")
            sent, overflowed = map(int, talker.line().split())
            hear_to(sent, listener, came)
            assert came == [list(range(1, sent + 1))] * 5
            assert overflowed == 0


def test_a_peer_that_stands_still_delays_nobody_and_gets_whole_messages_afterwards(master: Master) -> None:
    with (
        Program(master, LISTENER, "stalled", "2") as stalled,
        Program(master, LISTENER, "quick", "2") as quick,
    ):
        assert stalled.line() == quick.line() == "listening"
        # 12 kB a message: the system's sockets are soon full
        with Program(master, TALKER, "talker", "2", "400", "50") as talker:
            assert talker.line() == "connected"
            whole: list[list[int]] = [[], []]
            broken: list[list[int]] = [[], []]
            hear_to(1, quick, whole)
            hear_to(1, stalled, broken)
            with stalled.standing_still():
                told, sent = talker.line().split()  # whoever waited for that peer would not come to say it
                assert told == "overflow"
                hear_to(int(sent) + 100, quick, whole)
            talker.say("end")
            sent, overflowed = map(int, talker.line().split())
            hear_to(sent, quick, whole)
            hear_to(sent, stalled, broken)
            # both peers' misses are counted; the quick one's, too, where the machine let it wait
            missed = 0
            for came in (*whole, *broken):
                assert came == sorted(set(came))
                assert came[-1] == sent
                missed += sent - came[0] + 1 - len(came)
            assert missed == overflowed > 0


def test_a_peer_that_dies_ends_for_itself_alone(master: Master) -> None:
    with Program(master, LISTENER, "dying", "3") as dying, Program(master, LISTENER, "living", "3") as living:
        assert dying.line() == living.line() == "listening"
        with Program(master, TALKER, "talker", "3", "7", "10000") as talker:
            assert talker.line() == "connected"
            hear_to(1, dying, [[], [], []])
            dying.process.kill()
            with Program(master, LISTENER, "dying", "3") as back:
                assert back.line() == "listening"
                here: list[list[int]] = [[], [], []]
                again: list[list[int]] = [[], [], []]
                hear_to(1, back, again)
                talker.say("end")
                sent = int(talker.line().split()[0])
                hear_to(sent, living, here)
                hear_to(sent, back, again)
                for numbers in (*here, *again):
                    assert numbers == list(range(numbers[0], sent + 1))


def test_a_late_peer_gets_the_last_message_of_a_latched_topic_once(master: Master) -> None:
    code = (
        OPEN
        + """
publisher = transport.publisher("/state", STATE, latch=True)
content = bytes(frame_of(STATE, message_class(STATE)(header(0), "ENABLED", True, False)))
sheet = Sheet([Frame(content)], 0)
bundle = transport.bundle([publisher], sheet)
sheet.heard[:] = True
for stamp in (1, 2, 3):
    sheet.write(stamp)
    bundle.send()
print("sent")
sys.stdin.readline()
"""
    )
    reader = (
        OPEN
        + """
subscription = transport.subscribe("/state", STATE)
got = subscription.take(PATIENCE)
time.sleep(0.2)
print(*(f"{m.state} {m.header.stamp} {m.header.seq}" for m, _ in got + subscription.take()))
"""
    )
    with Program(master, code, "talker") as talker:
        assert talker.line() == "sent"
        with Program(master, reader, "late") as late:
            assert late.line() == "ENABLED 3 3"


def test_no_frame_goes_into_a_file_that_got_the_number_of_a_closed_socket(
    master: Master, tmp_path: Path
) -> None:
    """Connections are closed by rospy's threads at any time, and their numbers are given to whatever is opened next."""
    code = (
        HEARD
        + """
import os
sheet.write(1)
bundle.send()
(link,) = publisher._publication.connections
number = link.fileno()
link._connection.close()  # as rospy does, without a word to the bundle
held = [os.open(f"{sys.argv[2]}/{k}", os.O_RDWR | os.O_CREAT) for k in range(50)]
assert number in held
for _ in range(10):
    bundle.send()
print(sum(os.fstat(one).st_size for one in held), len(transport.connections("/t0").subscribers))
"""
    )
    with Program(master, LISTENER, "listener", "1") as listener:
        assert listener.line() == "listening"
        with Program(master, code, "talker", str(tmp_path)) as talker:
            assert talker.line() == "0 0"


def test_rospys_statistics_count_what_was_sent_together(master: Master) -> None:
    code = (
        HEARD
        + """
(before,) = publisher._publication.get_stats()[2]
for _ in range(10):
    bundle.send()
(after,) = publisher._publication.get_stats()[2]
print(after[2] - before[2], after[1] - before[1] == 10 * len(sheet.frame(0)))
"""
    )
    with Program(master, LISTENER, "listener", "1") as listener:
        assert listener.line() == "listening"
        with Program(master, code, "talker") as talker:
            assert talker.line() == "10 True"
