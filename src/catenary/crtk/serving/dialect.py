"""What dialects share: arms that are published verb by verb, and commands that are obeyed verb by verb."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_values import pose_message
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.state_machine import why_not_obeyed
from catenary.crtk.topic_names import CrtkTopic
from catenary.crtk.transport import Transport
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.spatial import Pose

Vector3 = message_class("geometry_msgs/Vector3")
_JointState = message_class("sensor_msgs/JointState")
_Twist, _TwistStamped = (message_class(f"geometry_msgs/{name}") for name in ("Twist", "TwistStamped"))


class LazyPublisher:
    """A topic that a server publishes, while somebody listens."""

    def __init__(self, transport: Transport, topic: CrtkTopic) -> None:
        self.topic = topic
        self._latched = topic.is_latched  # whoever comes later knows it at once
        self.publisher = transport.publisher(topic.name, topic.type, latch=self._latched)
        self.publish = self.publisher.publish
        self.heard = True
        # whether the last message, which a latched topic gives to newcomers, is to be a new one
        self.due = True

    def watch(self) -> None:
        """Look whether anybody listens; called some thirty times a second."""
        self.heard = self.publisher.is_heard()
        self.due = self._latched


Publishers = Mapping[tuple[str, str | None], LazyPublisher]  # by verb and arm
MakeMessage = Callable[[ServedArm, int], Message]  # arm, stamp [ns]
Obey = Callable[[ServedArm, Message], None]


class Service(NamedTuple):
    """A service of a robot."""

    name: str
    type: str
    answer: Callable[[Message], Message]


class Dialect:
    """A dialect: what is published, and what is obeyed."""

    services: tuple[Service, ...] = ()  # that its robots offer
    is_one_robot = False  # whether a state command to one arm is one to all

    def __init__(
        self,
        arms: Mapping[str, ServedArm],
        topics: tuple[CrtkTopic, ...],
        published: Mapping[str, MakeMessage],
        obeyed: Mapping[str, Obey],
    ) -> None:
        self.arms, self.topics = arms, topics
        self._published, self._obeyed = published, obeyed
        self._publishers: list[tuple[LazyPublisher, MakeMessage, ServedArm]] = []  # none before `begin`

    def begin(self, publishers: Publishers) -> None:
        """Prepare to publish by publishers; called once, before `publish`."""
        self._publishers = [
            (publishers[verb, name], make, arm)
            for name, arm in self.arms.items()
            for verb, make in self._published.items()
            if (verb, name) in publishers
        ]

    def publish(self, now: int) -> None:
        """Publish the arms' states, stamped `now` [ns], where anybody listens or may come and find an old one."""
        made = [(lazy, make(arm, now)) for lazy, make, arm in self._publishers if lazy.heard or lazy.due]
        for lazy, message in made:
            lazy.due = False
            lazy.publish(message)

    def answer(self, arm: ServedArm, now: int) -> None:
        """Answer a state command to an arm, before it is obeyed; here its state is published all the time."""

    def settle(self) -> str | None:
        """Do to the arms what the state of one asks of the others; say it, where it is news."""
        return None

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Have the arm of a topic obey, unless it is in no state to be moved; state commands are the server's."""
        do = self._obeyed.get(topic.verb)
        if topic.arm is None or do is None:
            raise InputError("the robot has no such arm")
        arm = self.arms[topic.arm]
        if not arm.machine.can_change:
            raise InputError("the arm is parked")
        if not arm.is_ready:
            raise InputError(why_not_obeyed(arm.state))
        do(arm, message)


def single_number(message: Message) -> float:
    """Return the single position of a JointState: an opening of the jaws, or a change of it [rad]."""
    return float(as_array("JointState.position", message.position, (1,))[0])


def joints_and_tool(child: str | None = None) -> dict[str, Callable[[ServedArm, int], Message]]:
    """Return the topics that both dialects publish of an arm in every tick: verb and message at a stamp [ns].

    Poses are TransformStamped where `child`, the tool's frame, is given; velocities [m/s, rad/s] in base axes.
    """

    def pose(arm: ServedArm, pose: Pose, stamp: int) -> Message:
        return pose_message(arm.settings.placed(pose), stamp, arm.settings.base_name, child=child)

    return {
        "measured_js": lambda arm, stamp: _joint_state(arm, arm.measured, stamp),
        "setpoint_js": lambda arm, stamp: _joint_state(arm, arm.setpoint, stamp),
        "measured_cp": lambda arm, stamp: pose(arm, arm.measured_tool.pose, stamp),
        "setpoint_cp": lambda arm, stamp: pose(arm, arm.setpoint_tool.pose, stamp),
        "measured_cv": lambda arm, stamp: _twist(arm, arm.measured_tool.twist, stamp),
        "setpoint_cv": lambda arm, stamp: _twist(arm, arm.setpoint_tool.twist, stamp),
    }


def _twist(arm: ServedArm, twist: Floats, stamp: int) -> Message:
    x, y, z, a, b, c = arm.settings.turned(twist.reshape(2, 3)).ravel().tolist()
    return _TwistStamped(header(stamp, arm.settings.base_name), _Twist(Vector3(x, y, z), Vector3(a, b, c)))


def _joint_state(arm: ServedArm, state: JointState, stamp: int) -> Message:
    n = len(arm.reported)
    return _JointState(header(stamp), arm.reported, state.q[:n], state.qd[:n], state.tau[:n])


def jaw(arm: ServedArm, state: JointState, stamp: int, name: str = "jaw") -> Message:
    """Return the opening of the jaws in a state, jaw1 + jaw2, with the mean of both efforts."""
    jaws = arm.tool.jaws
    position, velocity, effort = (row[-jaws:].sum() for row in (state.q, state.qd, state.tau))
    return _JointState(header(stamp), (name,), [position], [velocity], [effort / jaws])
