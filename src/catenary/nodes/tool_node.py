"""A wrist's force/torque sensor as topics without the tool behind it; the tool weighed from the same topics."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.gravity_topic import PublishedGravity
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_queues import Subscription
from catenary.crtk.transport import Transport
from catenary.errors import ExcitationError, InputError
from catenary.robots.model import RobotModel
from catenary.sensing.tool_compensation import JointMotion, RestPoses, ToolCompensation, ToolReading
from catenary.sensing.wrist_tool import WristTool
from catenary.spatial import LEVEL
from catenary.topics import SECOND
from catenary.verdict.finding import judge

_TOPIC, WRENCH = "/tool/wrench", "geometry_msgs/WrenchStamped"
TOOL_RATE = 500.0  # [Hz] of looks at the topics
_JOINTS_HELD_S, _GRAVITY_HELD_S, _READINGS_HELD_S = 0.1, 0.5, 0.5  # [s] for which joints, gravity and readings count
_CLOCKS_APART_S = 1.0  # [s] between a stamp and its arrival: more, and the sender's clock is another one
_SENSED_DEVIATION = 0.05  # [m/s2] of gravity that a node measures
_STATUS_EVERY_S = 1.0
_XYZ = message_class("geometry_msgs/Vector3")


class ToolStatus(NamedTuple):
    """Status of the node."""

    seconds: float  # since it began
    status: str  # live, zeroing or weighing, or why nothing is published
    wrench: Floats  # (6,) as last published [N, Nm]; NaN before
    deviation: Floats  # (6,)
    age_s: float  # of the oldest of what that was computed from, when it was published
    published: int  # wrenches
    poses: int  # at rest, that were seen
    subscribers: int
    is_up: bool  # whether the transport's network answers
    warnings: tuple[str, ...]

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in SI."""
        return self._asdict()


class ToolNode:
    """Publishes each WrenchStamped less the tool, and beside it its `deviation`, `age` [s] and `status`.

    The `command` "zero" (std_msgs/String) takes the next half second at rest for the sensor's zero, "weigh" weighs
    the tool again, in poses at rest, from the sensor and the joints. A wrench is that of the environment on the tool.
    Nothing is published without fresh joints, and gravity where it is asked for.
    """

    def __init__(
        self,
        transport: Transport,
        model: RobotModel,
        tool: WristTool | None,
        *,
        wrench: str = "/wrench",
        joints: str = "/joint_states",
        gravity: str | None = None,
        topic: str = _TOPIC,
        sensor_frame: str | None = None,
        poses: int = 12,
        accept: Sequence[str] = (),
        wait: float = 0.0,
        weighed: Callable[[WristTool], None] = lambda tool: None,
        **how: Any,
    ) -> None:
        """Hear sensor, joints and, in base axes, gravity (that of a level base when None).

        Args:
            tool: None to weigh it first, in `poses`, at `sensor_frame`, the tip when None.
            accept: Findings that keep no tool from being used.
            wait: For joint states after each reading [s]; see `JointMotion`.
            weighed: Gets each tool that was weighed.
            how: Options of `ToolCompensation`.
        """
        self.transport, self.model, self.joints = transport, model, joints
        self._readings = transport.subscribe(wrench, WRENCH)
        self._states = transport.subscribe(joints, "sensor_msgs/JointState")
        self._commands = transport.subscribe(f"{topic}/command", "std_msgs/String")
        self._gravity = None if gravity is None else PublishedGravity(transport, gravity)
        self._wrench, self._deviation = (transport.publisher(name, WRENCH) for name in (topic, f"{topic}/deviation"))
        self._age = transport.publisher(f"{topic}/age", "std_msgs/Float64")
        self._status = transport.publisher(f"{topic}/status", "std_msgs/String", latch=True)
        self._least, self._accept, self._weighed = poses, accept, weighed
        self._how = {**how, "wait": wait, "gravity_deviation": 0.0 if gravity is None else _SENSED_DEVIATION}
        self._frame = sensor_frame if tool is None else tool.frame or None
        self._motion, self._rests = JointMotion(model.n, wait), RestPoses(model, self._frame)
        self._compensation = None if tool is None else ToolCompensation(model, tool, **self._how)
        self._waiting, self._last_status, self._last_status_at = list[tuple[float, Message]](), "", -math.inf
        self._heard = -math.inf  # [s] when a reading came last
        self._complaint = self._refusal = ""  # what the last reading lacked; why a command, or a weighing, was in vain
        self._last, self.published, self._age_s = ToolReading(np.full(6, np.nan), np.full(6, np.nan)), 0, math.inf

    @property
    def motion(self) -> JointMotion:
        """The joints' motion, as heard."""
        return self._motion if self._compensation is None else self._compensation.motion

    def step(self) -> int:
        """Publish what readings have come for since the last call; return how many."""
        for message, _ in self._commands.take():
            self._execute(message.data.strip())
        for time, message in self._take(self._states):
            self._receive_joints(time, message)
        before = self.published
        readings = self._take(self._readings)
        self._heard = self.transport.steady() / SECOND if readings else self._heard
        self._waiting += readings
        while self._waiting and self._is_due(self._waiting[0][0]):
            self._read(*self._waiting.pop(0))
        now, text = self.transport.steady() / SECOND, "; ".join((self._text(), *self._warnings()))
        if text != self._last_status or now - self._last_status_at >= _STATUS_EVERY_S:
            self._last_status, self._last_status_at = text, now
            self._status.publish(message_class("std_msgs/String")(text))
        return self.published - before

    def _take(self, subscription: Subscription) -> list[tuple[float, Message]]:
        """Return a new message with its time [s], by its stamp where the sender's clock is ours."""
        received, by = [], self.transport.clock.set_by()
        for message, arrived in subscription.take():
            stamp = message.header.stamp - by if message.header.stamp else arrived
            received.append(((stamp if abs(stamp - arrived) < _CLOCKS_APART_S * SECOND else arrived) / SECOND, message))
        return received

    def _execute(self, command: str) -> None:
        if command == "zero" and self._compensation is not None:
            self._compensation.begin_zero(self.transport.steady() / SECOND)
        elif command == "weigh":
            self._motion, self._compensation = self.motion, None
            self._rests, self._refusal = RestPoses(self.model, self._frame), ""
        else:
            self._refusal = f'command "{command}": expected weigh, or zero once the tool is known'

    def _receive_joints(self, time: float, message: Message) -> None:
        names = self.model.joint_names
        q, qd = (
            np.array([dict(zip(message.name, values, strict=False)).get(name, math.nan) for name in names])
            for values in (message.position, message.velocity)
        )
        if np.isfinite(q).all():
            self.motion.put(time, q, qd if np.isfinite(qd).all() else None)

    def _is_due(self, time: float) -> bool:
        """Return True if the joints' motion around a reading is known, or will not become known."""
        now = self.transport.steady() / SECOND
        return self.motion.newest >= time + self.motion.wait or now - time > self.motion.wait + _JOINTS_HELD_S

    def _read(self, time: float, message: Message) -> None:
        reading = np.array([*message.wrench.force, *message.wrench.torque])
        gravity, gravity_age = (LEVEL, 0.0) if self._gravity is None else self._gravity.now()
        self._complaint = self._missing(time, reading, gravity_age)
        if self._complaint:
            return
        if self._compensation is None:
            q, qd, _ = self.motion.at(time)
            if self._rests.add(time, q, qd, reading, gravity) and len(self._rests.poses) >= self._least:
                self._weigh()
            return
        self._last = self._compensation.update(time, reading, gravity)
        now = self.transport.steady() / SECOND
        self._age_s = max(now - min(time, self.motion.newest), gravity_age)
        frame = self._how.get("frame") or message.header.frame_id
        head = header(message.header.stamp or self.transport.now(), frame)
        for publisher, values in zip((self._wrench, self._deviation), self._last, strict=True):
            vectors = message_class("geometry_msgs/Wrench")(_XYZ(*values[:3].tolist()), _XYZ(*values[3:].tolist()))
            publisher.publish(message_class(WRENCH)(head, vectors))
        self._age.publish(message_class("std_msgs/Float64")(self._age_s))
        self.published += 1

    def _missing(self, time: float, reading: Floats, gravity_age: float) -> str:
        """Return the reason why a reading cannot be compensated yet; empty if it can."""
        if not np.isfinite(reading).all():
            return "readings are not finite"
        if time - self.motion.newest > _JOINTS_HELD_S:
            return f"no joints of {self.model.name} on {self.joints}"
        return "gravity is not live" if gravity_age > _GRAVITY_HELD_S else ""

    def _weigh(self) -> None:
        try:
            tool, doubts = self._rests.weigh()
            judge([("poses", finding) for finding in doubts], self._accept, done="weighed")
        except ExcitationError as error:  # further poses mend it
            self._refusal = str(error)
            return
        except InputError as error:
            self._refusal, self._rests = str(error), RestPoses(self.model, self._frame)
            return
        tool, motion = replace(tool, frame=self._frame or self.model.tip), self.motion
        self._weighed(tool)
        self._compensation, self._refusal = ToolCompensation(self.model, tool, **self._how), ""
        self._compensation.motion = motion

    def _text(self) -> str:
        if self.transport.steady() / SECOND - self._heard > _READINGS_HELD_S:
            return f"no wrenches on {self._readings.topic}"
        if self._complaint:
            return self._complaint
        if self._compensation is None:
            return f"weighing: {len(self._rests.poses)} poses at rest of {self._least}"
        return "zeroing" if self._compensation.is_zeroing else "live"

    def _warnings(self) -> tuple[str, ...]:
        own = "" if self._compensation is None else self._compensation.complaint
        return tuple(filter(None, (self._refusal, own)))

    def status(self, seconds: float) -> ToolStatus:
        """Return the status, `seconds` after the start."""
        listeners = len(self.transport.connections(self._wrench.topic).subscribers)
        rests = self._rests if self._compensation is None else self._compensation.rests
        begin = seconds, self._text(), *self._last, self._age_s
        return ToolStatus(*begin, self.published, len(rests.poses), listeners, self.transport.is_up(), self._warnings())
