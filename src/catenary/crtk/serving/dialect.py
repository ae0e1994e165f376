"""What dialects share: arms that are published verb by verb, and commands that are obeyed verb by verb."""

from collections.abc import Callable, Mapping

from catenary.arrays import as_array
from catenary.crtk.message import Message
from catenary.crtk.serving.arm_messages import Service
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.state_machine import why_not_obeyed
from catenary.crtk.topic_names import CrtkTopic
from catenary.crtk.transport import Transport
from catenary.errors import InputError


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
        """Speak for arms, over topics."""
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

    def settle(self) -> str | None:
        """Do to the arms what the state of one asks of the others; say it, where it is news."""
        return None

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Obey a command; state commands are the server's."""
        self.follow(topic, message, self._obeyed.get(topic.verb))

    def follow(self, topic: CrtkTopic, message: Message, do: Obey | None) -> None:
        """Have the arm of a topic do something, unless it is in no state to be moved."""
        if topic.arm is None or do is None:
            raise InputError("the robot has no such arm")
        arm = self.arms[topic.arm]
        if not arm.machine.can_change:
            raise InputError("the arm is parked")
        if not arm.is_ready:
            raise InputError(why_not_obeyed(arm.state))
        arm.obeys = topic.name
        do(arm, message)


def single_number(message: Message) -> float:
    """Return the single position of a JointState: an opening of the jaws, or a change of it [rad]."""
    return float(as_array("JointState.position", message.position, (1,))[0])
