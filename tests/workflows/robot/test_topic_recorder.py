import errno
import os
from collections import deque
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.loopback import Loopback
from catenary.crtk.message import codec, header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.errors import NotReadyError, RecordingError, TransportError
from catenary.raven2.topics import EXT_JPOS, RAVENSTATE_100HZ, in_channels, raven_topics
from catenary.recording.bag_reader import JournalReader, open_recording
from catenary.recording.import_formats.known_layouts import read_raven
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.journal import About
from catenary.topics import SECOND
from catenary.trajectories.reference import Trajectory
from catenary.workflows.project.calibrate import TRAIN
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.kinds import project_kind
from catenary.workflows.project.robot import RosRobot
from catenary.workflows.robot import topic_recorder
from catenary.workflows.robot.homing import AnswerYes
from catenary.workflows.robot.topic_recorder import Along, TopicRecorder, record_topics
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import OFFSET, START, EncodedPlant
from oracles.waves import Waves

SECONDS = 2.0


@pytest.fixture(scope="module")
def robot() -> RobotOnLoopback:
    return RobotOnLoopback(homed_plant())


@pytest.fixture(scope="module")
def journal(robot: RobotOnLoopback, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of a robot that nobody moves."""
    folder = tmp_path_factory.mktemp("recorded") / "journal"
    about = About(robot="raven2", simulated=True)
    record_topics(robot.transport, folder, raven_topics(state_rate=100.0), SECONDS, about=about)
    return folder


def test_ctrl_c_ends_a_recording_properly(robot: RobotOnLoopback, tmp_path: Path) -> None:
    def stop(share: float) -> None:
        if 0.5 < share < 1.0:
            raise KeyboardInterrupt("SIGTERM")

    ended = record_topics(robot.transport, tmp_path / "cut", raven_topics(), 1.0, progress=stop)
    assert ended.ended_by == "SIGTERM"
    assert ended.seconds == pytest.approx(0.5, abs=0.1)
    rows = next(count for count in ended.counts if count.name == "/ravenstate").kept
    assert len(stamps(tmp_path / "cut", "/ravenstate")) == rows > 0


def stamps(folder: Path, topic: str) -> Any:
    return np.array([stamp for _, stamp, _ in open_recording(folder).messages((topic,))])


def test_a_recorder_that_stood_still_says_when(tmp_path: Path) -> None:
    robot = RobotOnLoopback(EncodedPlant(), every=5)
    with TopicRecorder(robot.transport, tmp_path / "stood", raven_topics(), about=About(robot="raven2")) as recorder:
        for pause in (0.0, 0.02, 3.0, 0.4):
            robot.transport.sleep(pause)
            recorder.collect()
        assert [one for one in recorder.problems() if "stalled" in one] == recorder.remarks
    reader = JournalReader(tmp_path / "stood")
    assert list(reader.messages())
    (remark,) = [one for one in reader.problems if "stalled" in one]
    assert "stalled for 3.0 s, 0.0 s after the start" in remark


def test_topics_come_at_the_rates_they_are_recorded_at(journal: Path) -> None:
    for topic in raven_topics(state_rate=100.0):
        assert_allclose(len(stamps(journal, topic.name)), SECONDS * topic.rate, atol=2)


def test_stamps_and_numbers_are_the_robots_own(journal: Path, robot: RobotOnLoopback) -> None:
    sources = Sources([journal])
    columns = {RAVENSTATE_100HZ.name: ["jpos[gold_insertion]"], EXT_JPOS.name: ["position[shoulder]"]}
    state, encoders = (sources.read(columns)[name] for name in columns)
    assert (state.stamp <= state.arrival).all()
    assert (state.arrival - state.stamp < 2_000_000).all()  # loopback: the same tick
    held = robot.robot.plant.measured_js().q[2]
    assert_allclose(state.columns["jpos[gold_insertion]"][-1], held, atol=1e-6)  # float32 on the way
    assert sources.about.robot == "raven2"
    assert_allclose(encoders.columns["position[shoulder]"], robot.robot.plant.external_encoders()[0], atol=1e-3)


class Box:
    """A program whose messages of a topic at 100 Hz are recorded as they come."""

    def __init__(self, folder: Path) -> None:
        self.robot = RobotOnLoopback(EncodedPlant(), encoders=False)
        self.publisher = Loopback("box", self.robot.network).publisher(EXT_JPOS.name, EXT_JPOS.type)
        self.recorder = TopicRecorder(self.robot.transport, folder, (EXT_JPOS,))

    def send(self, stamp: float) -> None:
        message = joint_state_message(EXT_JPOS.joint_names, round(stamp * SECOND), [0.1, 0.2, 0.3])
        self.publisher.publish(message)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("rate", "jitter", "burst", "kept"),
    [
        (100.0, 0.1, 1, 200),  # an encoder box sends unevenly
        (90.0, 0.1, 1, 200),
        (100.0, 0.0, 40, 200),  # a busy machine lets forty in at once
        (1000.0, 0.0, 100, 20),
    ],
)
def test_a_topic_is_thinned_by_its_stamps(tmp_path: Path, rate: float, jitter: float, burst: int, kept: int) -> None:
    box, rng = Box(tmp_path / "r"), np.random.default_rng(0)
    stamps = 10.0 + np.arange(200) / rate + rng.uniform(-jitter, jitter, 200) / rate
    with box.recorder:
        for first in range(0, 200, burst):
            box.robot.clock.sleep(burst / rate)
            for stamp in stamps[first : first + burst]:
                box.send(stamp)
            box.recorder.collect()
    (count,) = box.recorder.counts
    assert count.came == 200
    assert count.kept == pytest.approx(kept, abs=1)
    assert count.thinned == 200 - count.kept


def test_a_publisher_whose_clock_is_set_back_is_recorded_all_the_same(tmp_path: Path) -> None:
    box = Box(tmp_path / "r")
    with box.recorder:
        for k in range(100):
            box.robot.clock.sleep(0.01)
            box.send(0.0 if k < 20 else 5000.0 + 0.01 * k - 3600.0 * (k > 60))  # without a stamp in the beginning
            box.recorder.collect()
    assert box.recorder.counts[0].kept == pytest.approx(100, abs=1)


def test_a_topic_that_falls_silent_is_noted_with_how_long(tmp_path: Path) -> None:
    box = Box(tmp_path / "r")
    with box.recorder:
        for k in range(400):
            box.robot.clock.sleep(0.01)
            if not 100 <= k < 300:
                box.send(10.0 + 0.01 * k)
            box.recorder.collect()
    reader = JournalReader(tmp_path / "r")
    assert len(list(reader.messages())) == 200
    (remark,) = [one for one in reader.problems if "no message" in one]
    assert "/ext_jpos: no message for 2.0 s, 1.0 s after the start" in remark
    assert box.recorder.counts[0].longest_gap == pytest.approx(2.01, abs=1e-3)


def test_topic_that_never_comes_or_has_another_type_is_refused(tmp_path: Path) -> None:
    robot = RobotOnLoopback(homed_plant(), encoders=False)
    with pytest.raises(RecordingError, match=r"nothing came of /ext_jpos"):
        record_topics(robot.transport, tmp_path / "a", raven_topics(), 0.1, required=("/ext_jpos",))
    Loopback("box", robot.network).publisher("/ext_jpos", "std_msgs/String")
    with pytest.raises(TransportError, match="carries std_msgs/String"):
        TopicRecorder(robot.transport, tmp_path / "b", raven_topics())


def test_messages_not_collected_in_time_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topic_recorder, "QUEUE_DEPTH", 100)
    robot = RobotOnLoopback(homed_plant())
    with TopicRecorder(robot.transport, tmp_path / "r", raven_topics()) as recorder:
        robot.clock.sleep(0.12)
        recorder.collect()
    assert any("came faster" in problem for problem in recorder.problems())


@pytest.mark.parametrize("by", [3600.0, -3600.0])
def test_setting_the_machines_clock_costs_no_message_and_is_noted(tmp_path: Path, by: float) -> None:
    robot = RobotOnLoopback(homed_plant())
    robot.robot.plant.state_command("enable")
    with TopicRecorder(robot.transport, tmp_path / "r", raven_topics()) as recorder:
        for tick in range(20):
            robot.clock.ahead = round(by * SECOND) * (tick >= 10)
            robot.robot.plant.servo_jp(robot.robot.plant.setpoint_js().q + 2e-4)
            robot.clock.sleep(0.02)
            recorder.collect()
    assert any(f"set by {by:+.3f} s, 0.2 s after" in problem for problem in recorder.problems())
    read = read_raven([tmp_path / "r"])
    assert any(f"set by {by:+.3f} s" in note for note in read.log.notes)
    for topic in read.topics:
        assert topic.longest_gap < 0.05, topic
        assert not topic.shuffled, topic
    log = read.log
    assert len(log) >= 12
    assert log.time is not None
    assert_allclose(log.time[-1], 0.4, atol=0.05)
    assert log.ok[2:-2].all()
    assert (np.diff(log.q_nominal[:, 0]) > -1e-6).all()  # as it moved


def test_full_disk_keeps_what_was_recorded_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = RobotOnLoopback(homed_plant())
    recorder = TopicRecorder(robot.transport, tmp_path / "r", raven_topics(state_rate=100.0))
    robot.clock.sleep(0.5)
    kept = recorder.collect()
    recorder.journal.flush()

    def full(*_: Any) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(os, "write", full)
        robot.clock.sleep(0.5)
        with pytest.raises(RecordingError, match=f"No space left.*first {kept} of"):
            recorder.collect() and recorder.journal.flush()
    assert len(list(open_recording(tmp_path / "r").messages())) == kept


RATE = 100.0  # [Hz] of /ext_jpos
STEP = 0.02  # [s] by which arrivals and ticks of the motion may be apart


def recorded(folder: Path) -> tuple[np.ndarray, np.ndarray, JournalReader]:
    """Arrivals [s] and joints (N, 3) of the external encoders, as they lie in the recording."""
    reader = JournalReader(folder)
    decode = codec("sensor_msgs/JointState").decode
    rows = [(arrival, decode(data).position) for name, arrival, data in reader.messages() if name == "/ext_jpos"]
    arrivals, q = zip(*rows, strict=True)
    return np.array(arrivals) * 1e-9, np.array(q) - OFFSET, reader


class Late:
    """A publisher whose messages arrive some time after they were sent, as over a busy machine."""

    def __init__(self, setup: RobotOnLoopback, verb: str) -> None:
        self.robot, self.publisher, self.waiting, self.delay = setup.robot, setup.robot._out[verb], deque(), 0
        setup.robot._out[verb] = self
        setup.clock.robots.append(self)

    def publish(self, message) -> None:
        self.waiting.append((self.robot.ticks + self.delay, message))

    def tick(self) -> None:
        while self.waiting and self.waiting[0][0] <= self.robot.ticks:
            self.publisher.publish(self.waiting.popleft()[1])


def interrupted(tmp_path: Path, motion: Trajectory, stops: dict, delays=()) -> Path:
    """Record, be stopped at shares of the motion, and call again until it is done; return the recording.

    In each run messages come late by another delay [ms].
    """
    setup = RobotOnLoopback(EncodedPlant(), every=5)
    late = [Late(setup, verb) for verb in list(setup.robot._out)] if delays else []
    project = Project(tmp_path / "project", ProjectSettings(connection="ros1"))
    robot = RosRobot(setup.transport, AnswerYes(), simulated=True, patience=1.0)
    robot.home(project)
    for share, stop, delay in zip(stops, stops.values(), delays or [0] * len(stops), strict=True):
        for one in late:
            one.delay = delay

        def at(done: float, share: float = share, stop=stop) -> None:
            if done > share:
                stop(setup)

        with pytest.raises((KeyboardInterrupt, NotReadyError)):
            robot.record(project, TRAIN, motion, "waves", after="home", progress=at)
        if setup.robot.plant.operating_state().state == "PAUSED":
            setup.robot.plant.state_command("resume")
        setup.transport.sleep(1.0)  # somebody comes and starts it again
    for one in late:
        one.delay = 0
    assert robot.record(project, TRAIN, motion, "waves", after="home")
    return project.folder / "recordings" / TRAIN


def interrupt(_) -> None:
    raise KeyboardInterrupt


def pedal(setup) -> None:
    setup.robot.plant.state_command("pause")


def holds_the_motion_once(folder: Path, motion: Trajectory, gaps: int) -> None:
    arrivals, q, reader = recorded(folder)
    told = [remark for remark in reader.problems if "cut off, and went on" in remark]
    breaks = np.flatnonzero(np.diff(arrivals) > 0.5) + 1
    assert len(told) == len(breaks) == gaps
    assert (np.diff(arrivals) > 0.0).all()
    assert (reader.lost, reader.damage, reader.ends_early) == (0, [], False)
    begins = [0.0, *(float(remark.rpartition(" from ")[2].partition(" s")[0]) for remark in told)]
    end = 0.0
    for begin, rows in zip(begins, np.split(np.arange(len(arrivals)), breaks), strict=True):
        assert begin == pytest.approx(end, abs=0.1 + STEP)  # told to a tenth; no stretch twice, none left out
        times = arrivals[rows] - arrivals[rows[0]] + end
        fastest = np.abs(motion.sample(times)[1]).max(axis=0)
        worst = np.abs(q[rows] - motion.sample(times)[0]).max(axis=0)
        assert (worst < 2 * STEP * fastest).all()
        end = times[-1] + 1.0 / RATE
    assert end == pytest.approx(motion.duration, abs=2 * STEP)
    assert len(arrivals) == pytest.approx(RATE * motion.duration, abs=3 * (gaps + 1))


def test_each_stretch_of_the_motion_is_recorded_once(tmp_path: Path) -> None:
    motion = Waves(6.0, START[:3])
    folder = interrupted(tmp_path, motion, {0.3: interrupt, 0.5: pedal, 0.8: interrupt}, delays=(0, 150, 100))
    holds_the_motion_once(folder, motion, 3)
    assert not (tmp_path / "project" / "replaced").exists()
    told = [remark for remark in recorded(folder)[2].problems if " ended it, " in remark]
    assert [remark.partition(" ended it")[0].partition(": ")[2] for remark in told] == [
        "this program",
        "the robot",
        "this program",
    ]


def test_what_another_homing_measured_is_not_mixed_in(tmp_path: Path) -> None:
    def unhome(setup) -> None:
        setup.robot.plant.state = setup.robot.plant.operating_state()._replace(is_homed=False)
        raise KeyboardInterrupt

    motion = Waves(3.0, START[:3])
    folder = interrupted(tmp_path, motion, {0.6: unhome})
    holds_the_motion_once(folder, motion, 0)


@pytest.mark.parametrize("robot", ["raven2", "dvrk_psm"])
def test_how_far_a_recording_got_is_told_by_its_setpoints_on_the_motion_itself(robot: str) -> None:
    """Ticks that come late delay the motion, messages come by bursts; its sweeps lie side by side."""
    kind, rng = project_kind(ProjectSettings(robot=robot)), np.random.default_rng(1)
    motion, (topic, setpoint) = kind.excitation()[0], kind.setpoint
    sent = np.arange(0.0, 0.9 * motion.duration, 1.0 / 30.0)
    place = np.cumsum(np.where(rng.random(len(sent)) < 0.02, 0.3, 1.0) / 30.0)
    bursts = np.where(rng.random(len(sent)) < 0.005, 0.3, 0.0)
    arrival = np.maximum.accumulate(sent + bursts + np.abs(rng.normal(0.0, 0.01, len(sent))))
    q, kind_of_message, encode = motion.sample(place)[0], message_class(topic.type), codec(topic.type).encode
    messages = []
    for at, row in zip(arrival, q, strict=True):
        if robot == "raven2":
            fields = {"jpos_d": in_channels("gold", np.append(row, np.zeros(4))) * 180.0 / np.pi}
        else:
            fields = {"position": row}
        messages.append((topic.name, SECOND + round(at * SECOND), encode(kind_of_message(header(0), **fields), 0)))
    for cut in rng.integers(10, len(messages), 5).tolist():
        run = SimpleNamespace(begins=None, messages=lambda cut=cut: iter(messages[:cut]))
        reader: Any = SimpleNamespace(last_run=lambda run=run: [run])
        assert Along(motion, topic, setpoint).reached(reader) == pytest.approx(place[cut - 1], abs=0.01)
