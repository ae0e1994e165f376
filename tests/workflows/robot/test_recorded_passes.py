"""A recording of a robot that is interrupted goes on: every stretch of the motion once, and what is missing is told."""

import os
from collections import deque
from pathlib import Path

import numpy as np
import pytest

from catenary.crtk.message_bytes import codec
from catenary.errors import NotReadyError
from catenary.recording.bag_reader import JournalReader
from catenary.trajectories.reference import Trajectory
from catenary.workflows.project.calibrate import TRAIN
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import RosRobot
from catenary.workflows.robot import recorded_passes
from catenary.workflows.robot.homing import AnswerYes
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import OFFSET, START, EncodedPlant
from oracles.waves import Waves

RATE = 100.0  # [Hz] of /ext_jpos
MINUTES = float(os.environ.get("ENDURANCE_MINUTES", "2"))
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
        setup.transport.sleep(2.0)  # somebody comes and starts it again
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


@pytest.mark.parametrize("delays", [(), (0, 150, 100)], ids=["at once", "late"])
def test_each_stretch_of_the_motion_is_recorded_once(delays, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_passes, "PASS", 1.0)
    motion = Waves(9.0, START[:3])
    folder = interrupted(tmp_path, motion, {0.3: interrupt, 0.5: pedal, 0.8: interrupt}, delays)
    holds_the_motion_once(folder, motion, 3)
    assert len(list((tmp_path / "project" / "replaced").iterdir())) == 3  # the passes that were cut off


def test_what_another_homing_measured_is_not_mixed_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_passes, "PASS", 1.0)

    def unhome(setup) -> None:
        setup.robot.plant.state = setup.robot.plant.operating_state()._replace(is_homed=False)
        raise KeyboardInterrupt

    motion = Waves(3.0, START[:3])
    folder = interrupted(tmp_path, motion, {0.6: unhome})
    holds_the_motion_once(folder, motion, 0)


@pytest.mark.slow  # minutes of a robot's ticks
@pytest.mark.timeout(600.0 + 120.0 * MINUTES)
def test_minutes_that_are_interrupted_three_times(tmp_path: Path) -> None:
    motion = Waves(60.0 * MINUTES, START[:3])
    folder = interrupted(tmp_path, motion, dict.fromkeys((0.2, 0.5, 0.9), interrupt))
    holds_the_motion_once(folder, motion, 3)
    arrivals, _, _ = recorded(folder)
    # passes of 20 s each: what is driven again is less than a pass each time
    assert len(arrivals) == pytest.approx(6_000 * MINUTES, abs=10)
