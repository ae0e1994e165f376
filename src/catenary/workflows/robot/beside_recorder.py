"""Record a robot while something else moves it; a failed recording never stops the robot."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.raven_conversions import CHANNELS
from catenary.crtk.reader import CrtkReader
from catenary.errors import InputError, RecordingError
from catenary.recording.journal import About
from catenary.recording.recorder import Recorder
from catenary.recording.topics import Arm, raven_topics
from catenary.robots.catalog import RAVEN_SIDES
from catenary.simulation.cable_plant import REPORTED
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.topic_recorder import TopicRecorder

_PER_AXIS = tuple(REPORTED)
_ENCODERS = ("joint_enc", "ext_jpos")
_MEASURED = ("measured_js", "measured_js_velocity", "measured_js_effort")
COLLECT = 0.02  # [s] between two looks at what came over the wire


class BesideRecorder:
    """Records a RAVEN-II's topics into a folder; what fails ends the recording and nothing else."""

    def __init__(
        self, robot: OperatedRobot, folder: Path, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin a recording.

        Args:
            robot: A RAVEN-II, simulated here or behind a transport.
            folder: Where the journal goes; files of bounded size.
            clock: [s].

        Raises:
            InputError: Another robot, or a folder that holds a recording.
            RecordingError: The files cannot be made.
        """
        if robot.name not in RAVEN_SIDES:
            raise InputError(f"--record: records a RAVEN-II's topics; the robot is {robot.name}")
        self._robot, self._folder, self._clock = robot, folder, clock
        self._arm: Arm = "gold" if RAVEN_SIDES[robot.name] == "left" else "green"
        topics = raven_topics(self._arm)
        about = About(robot=robot.name, simulated=robot.plant.simulated, configuration={"motion": "by hand"})
        self._recorder: TopicRecorder | Recorder
        if isinstance(robot.plant, CrtkReader):
            self._recorder = TopicRecorder(robot.plant.transport, folder, topics, about=about)
        else:
            available = [*_PER_AXIS, *_ENCODERS, *_MEASURED, "runlevel", "type", "dt"]
            rng = np.random.default_rng(0)
            self._recorder = Recorder(folder, topics, available, rng, about=about, start_ns=time.time_ns())
            self._begin = robot.plant.measured_js().time
        self._looked, self._counted, self._messages, self._rate = -np.inf, clock(), 0, 0.0
        self.failure: str | None = None

    @property
    def messages(self) -> int:
        """Number of messages recorded until now."""
        return self._recorder.journal.messages

    def observe(self) -> str:
        """Record a tick; return a line on how the recording goes."""
        now = self._clock()
        if self.failure is None:
            try:
                self._take(now)
            except RecordingError as error:
                self.failure = str(error)
        if self.failure is not None:
            return f"recording ended: {self.failure}"
        if now - self._counted >= 1.0:
            self._rate = (self.messages - self._messages) / (now - self._counted)
            self._counted, self._messages = now, self.messages
        return f"recording {self._folder.name}: {self.messages} messages, {self._rate:.0f} /s"

    def close(self) -> str:
        """Finish the recording; return a line on what is in it."""
        try:
            self._recorder.close()
        except RecordingError as error:
            self.failure = self.failure or str(error)
        ended = "" if self.failure is None else f"; ended by: {self.failure}"
        return f"{self._folder}: {self.messages} messages recorded{ended}"

    def _take(self, now: float) -> None:
        if isinstance(self._recorder, Recorder):
            at = round(self._robot.plant.measured_js().time - self._begin, 6)
            if at >= self._recorder.next_due and at > 0.0:
                self._recorder.observe(at, self._columns())
        elif now - self._looked >= COLLECT:
            self._looked = now
            self._recorder.collect()

    def _columns(self) -> Mapping[str, Floats]:
        """Return what a simulated arm reports, in raven_state's channels, those of the other arm zero."""
        plant = self._robot.plant
        telemetry, state = plant.telemetry(), plant.measured_js()
        columns: dict[str, Floats] = {}
        for name in _PER_AXIS:
            columns[name] = np.zeros(16)
            columns[name][list(CHANNELS[self._arm])] = telemetry[name]
        columns |= {name: telemetry[name] for name in _ENCODERS}
        columns |= dict(zip(_MEASURED, (state.q, state.qd, state.tau), strict=True))
        running = 3.0 if plant.operating_state().state == "ENABLED" else 2.0  # pedal down, pedal up
        return columns | {
            "runlevel": np.array([running]),
            "type": np.zeros(2),
            "dt": np.array([plant.period]),
        }
