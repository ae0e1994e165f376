"""Several commands at one served robot over a real master; and a bag that is played in a robot's place."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from meeting import Meeting
from patience import until
from ros import PATIENT_COMMAND, Master, Program

# over DDS: tests/crtk/dds/test_served_faults.py
pytestmark = [pytest.mark.slow, pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"])]

# what rosbag play --loop does, by the library of Debian's python3-rosbag: its own binary is in another package
PLAY = """
import sys, time
from catenary.crtk.ros1.transport import make_rospy_importable
make_rospy_importable()
import rosbag, rospy
rospy.init_node("play")
bags = [rosbag.Bag(path) for path in sys.argv[1:]]
rows = sorted(((t.to_sec(), topic, m) for bag in bags for topic, m, t in bag.read_messages()), key=lambda row: row[0])
publishers = {topic: rospy.Publisher("/" + topic.lstrip("/"), type(m), queue_size=100) for _, topic, m in rows}
print("up")
sys.stdin.readline()
while True:
    first, begin = rows[0][0], time.monotonic()
    for at, topic, m in rows:
        time.sleep(max(0.0, begin + at - first - time.monotonic()))
        publishers[topic].publish(m)
    print("played")
"""


@pytest.fixture(scope="module")
def served(meeting: Meeting) -> Iterator[Program]:
    """A robot that is homed and ENABLED."""
    command = ("serve", "--ros", meeting.ros, "--homed", "--rate", "200", "--json")
    with Program(meeting.network, PATIENT_COMMAND, *command) as server:
        server.line()  # it is up
        meeting.resume()
        until(lambda: "ENABLED homed" in server.line())
        yield server


def ended_well(deploy: Program, report: str) -> bool:
    """Return whether a deployed model that Ctrl-C ended says by its exit code whether it kept up on this machine."""
    return deploy.process.returncode == (0 if json.loads(report)["keeps_up"] else 1)


def test_four_look_and_move_and_the_second_that_would_move_is_told_who_does(
    meeting: Meeting, served: Program, model: Path, tmp_path: Path
) -> None:
    network, ros = meeting
    command, project = PATIENT_COMMAND, str(tmp_path / "project")
    record = ("record", project, "--ros", ros, "--no-motion", "--hours", "0.002", "--simulated", "--json")
    with (
        Program(network, command, "monitor", "--ros", ros, "--json", "--rate", "5") as monitor,
        Program(network, command, "deploy", str(model), "--ros", ros, "--rate", "200", "--json") as deploy,
        Program(network, command, *record) as recorder,
    ):
        before = json.loads(monitor.line())["q"]
        goal = (
            "--joints",
            "shoulder",
            "--q",
            f"{before[0] + 0.5}",
            "--speed",
            "0.06",
            "--json",
        )  # while another starts
        with Program(network, command, "goto", "--ros", ros, "--simulated", *goal) as first:
            until(lambda: abs(json.loads(monitor.line())["q"][0] - before[0]) > 0.05)
            other = ("--joints", "elbow", "--q", f"{before[1] + 0.2}")
            with Program(network, command, "goto", "--ros", ros, "--simulated", *other) as second:
                _, errors = second.finish()
            assert second.process.returncode == 2
            assert f"/catenary_goto_{first.process.pid} holds the arm" in errors
            out, errors = first.finish()
        assert first.process.returncode == 0, errors
        shoulder, elbow = json.loads(out)["joints"][:2]
        assert shoulder["q"] == pytest.approx(before[0] + 0.5, abs=0.02)
        assert elbow["q"] == pytest.approx(before[1], abs=0.02)
        recorded, errors = recorder.finish()
        assert recorder.process.returncode == 0, errors
        assert min(topic["kept"] for topic in json.loads(recorded)["topics"]) > 0
        for program in (monitor, deploy):
            program.interrupt()
        report, errors = deploy.finish()
    assert ended_well(deploy, report), errors
    assert json.loads(report)["published"] > 500
    assert json.loads(report)["unreadable"] == 0


def test_a_played_bag_feeds_deploy_and_monitor_without_anybody_who_listens(
    ros_master: Master, meeting: Meeting, served: Program, model: Path, tmp_path: Path
) -> None:
    project, command = str(tmp_path / "project"), PATIENT_COMMAND
    record = ("record", project, "--ros", "1", "--no-motion", "--hours", "0.002", "--simulated", "--json")
    for line in (record, ("extract", project, "--bag", "ros1", "--json")):
        with Program(ros_master, command, *line) as program:
            out, errors = program.finish()
            assert program.process.returncode == 0, errors
    bags = json.loads(out)["test"]["bags"]
    served.process.terminate()
    _, errors = served.finish()
    assert served.process.returncode == 0
    assert "ended by SIGTERM: gold PAUSED homed" in errors
    with Program(ros_master, PLAY, *bags) as player:
        assert player.line() == "up"
        player.say("")
        with (
            Program(ros_master, command, "monitor", "--ros", "1", "--json", "--rate", "5") as monitor,
            Program(ros_master, command, "deploy", str(model), "--ros", "1", "--rate", "100", "--json") as deploy,
        ):
            assert np.isfinite(json.loads(monitor.line())["q"]).all()
            until(lambda: json.loads(monitor.line())["q_calibrated"] is not None)  # deploy has begun
            for _ in range(2):  # a whole time since
                assert player.line() == "played"
            deploy.interrupt()
            report, errors = deploy.finish()
    assert ended_well(deploy, report), errors
    assert json.loads(report)["published"] > 50
