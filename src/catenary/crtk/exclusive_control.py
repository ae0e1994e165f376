"""One program at a time moves an arm: a client hears others, a server refuses the second and misses the first.

An arm is one robot's: where two publish its joints, each would obey what is meant for the other, so none is moved.
"""

from collections.abc import Iterable, Mapping, Sequence

from catenary.crtk.dialects import DialectKind
from catenary.crtk.message_queues import Subscription
from catenary.crtk.topic_names import JOINT_STATE, WARNING
from catenary.crtk.transport import UNNAMED_NODE, Latest, Transport
from catenary.errors import RobotHeldError, TransportError
from catenary.raven2.topics import Arm
from catenary.topics import SECOND

STOPPING_COMMANDS = ("disable", "pause")  # state commands that are sent and obeyed at any time
_UNDER_WAY_NS = SECOND // 2  # [ns] from a program's last command until it is no longer taken to be moving the arm
LISTEN_S = 0.35  # [s] that a client listens before it begins
_HOLDS_TEXT = "holds the arm"


class OtherCommanders:
    """Hears who else commands an arm, until its own client does; from then on what the robot says of it."""

    def __init__(self, transport: Transport, dialect: DialectKind, arm: Arm, namespace: str | None) -> None:
        self._transport = transport
        self._heard: list[Subscription] = []
        self._last: tuple[str, str, int] | None = None  # program, topic, arrival [ns]
        self._told: Subscription | None = None
        self._refused: str | None = None
        for topic in dialect.topics(arm, namespace):
            if topic.moves and topic.verb not in ("hold", "free"):
                self._heard.append(transport.subscribe(topic.name, topic.type, depth=1))
            elif topic.verb == WARNING:
                self._told = transport.subscribe(topic.name, topic.type, depth=20)

    def listen(self, seconds: float = LISTEN_S) -> None:
        """Listen for a while, for the last time: what follows is the robot's to say."""
        if self._heard:
            self._transport.sleep(seconds)
            self.require_none()
            self.we_command()

    def require_none(self) -> None:
        """Read the messages that have arrived."""
        for heard in self._heard:
            for one in heard.take_arrivals():
                program = one.process.partition(" ")[0]
                if program and program.rpartition("/")[2] != self._transport.name:
                    self._last = program, heard.topic, one.time
        now = self._transport.steady()
        if self._last is not None and 0 <= now - self._last[2] < _UNDER_WAY_NS:
            program, topic, time = self._last
            raise RobotHeldError(
                f"{program} {_HOLDS_TEXT}: it commanded {topic} {(now - time) / SECOND:.2f} s ago; "
                "end it first, nothing has moved"
            )
        if self._told is not None and len(self._told):
            for message, _ in self._told.take():  # as `Commander.require_free` says it
                text, is_held, _ = message.data.partition(f" {_HOLDS_TEXT}")
                refused, _, holder = text.rpartition(" has to wait: ")
                if is_held and refused.rpartition(" ")[2].rpartition("/")[2] == self._transport.name:
                    raise RobotHeldError(f"{holder} {_HOLDS_TEXT}; the robot refused this program's commands")

    def we_command(self) -> None:
        """Note that the own client moves the arm; only the robot is listened to then."""
        while self._heard:
            self._heard.pop().close()

    def close(self) -> None:
        """Close all subscriptions."""
        self.we_command()
        if self._told is not None:
            self._told.close()


_LEASE_LATENESS_NS = 2 * SECOND  # [ns] that a lease which has run out is noticed late, at most
_GONE_AFTER_NS = 3 * SECOND  # [ns] without its connection: one that breaks is made again within a second or two
WATCH_EVERY_NS = SECOND // 10  # [ns] between two looks at who is connected


class Commander:
    """The program that moved an arm last; whoever can do so, where the transport does not tell programs apart.

    An arm whose program goes in the middle of a motion is to be paused after three seconds. One that let its arm rest
    before it ended, or is still connected and says nothing, or that another has followed, changes nothing. While one
    moves the arm, and for half a second after its last command, what others command is refused.

    Time in which the server itself stood still, or refused commands came in, does not count as rest of the program's.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._topic: str | None = None  # that it commanded by
        self._process: tuple[str, ...] = ()  # its name and address; none if the transport does not tell
        self._commanded = 0  # [ns] its last command that was obeyed, later by what the server stood still since
        self._heard = 0  # [ns] its last command that came in, obeyed or not
        self._looked, self._went_on = transport.steady(), 0  # [ns] last look, and end of the last stall
        self._stood = 0  # [ns] length of stalls after the last command, and of one just before it
        self._gone: int | None = None  # [ns] when it was first seen to be gone
        self._was_moving = False  # the arm, by itself, then

    def commands(self, topic: str, process: str, now: int) -> None:
        """Note a motion command that was obeyed, at `now` [ns]; `process` as in `Arrival.process`."""
        who = tuple(process.split())
        if self._topic is None or who != self._process:
            self._gone, self._heard, self._stood = None, 0, 0
        self._topic, self._process, self._commanded = topic, who, now

    def hears(self, came: Mapping[str, int]) -> None:
        """Note when commands of processes came in [ns], obeyed or not: signs of life of the one that moves."""
        for process, time in came.items():
            if self._is_same(process) and time > self._heard:
                self._heard = time
                if time > self._went_on + _UNDER_WAY_NS:  # else it may have come before the stall, and waited
                    self._stood = 0

    def require_free(self, process: str, now: int, *, is_moving: bool) -> None:
        """Refuse the command of a program, as in `Arrival.process`, while another one moves the arm; `now` in ns."""
        name = process.partition(" ")[0]  # a network has one program of a name
        if self._topic is None or not self._process or name in ("", self._process[0]) or self._is_same(process):
            return
        stood = max(0, now - self._looked - 2 * WATCH_EVERY_NS)  # a stall that `left` has not seen yet
        if is_moving or 0 <= now - self._commanded < _UNDER_WAY_NS + stood:
            raise RobotHeldError(f"{name} has to wait: {self._process[0]} {_HOLDS_TEXT} ({self._topic})")

    def forget(self, now: int) -> None:
        """Know of nobody, as when the arm is not enabled, at `now` [ns]."""
        self._topic, self._looked = None, now

    def _was_under_way(self, gone: int) -> bool:
        """Return True if a program that left at `gone` [ns] was moving the arm at its end."""
        shortest, longest = gone - self._heard - self._stood, gone - self._heard + self._stood
        return any(
            shortest < (lapse + _LEASE_LATENESS_NS if lapse else _UNDER_WAY_NS) and longest >= lapse - _UNDER_WAY_NS
            for lapse in self._transport.lapses
        )

    def _is_same(self, process: str) -> bool:
        """Return True if a process is the one that moves the arm: DDS may have learnt its node's name meanwhile."""
        return bool(self._process) and process.split()[-1:] == [*self._process[-1:]]

    def _is_connected(self, topic: str) -> bool:
        connected = self._transport.connections(topic).publishers
        if not self._process or {*self._process} & {*connected}:
            return bool(connected)
        if not self._process[0].startswith(UNNAMED_NODE):
            return False
        return any(self._is_same(one) for one in self._transport.publishing().get(topic, ()))

    def left(self, now: int, *, is_moving: bool) -> str | None:
        """Return who has left the arm in the middle of a motion for too long, once; called some ten times a second."""
        stall, self._looked = now - self._looked - 2 * WATCH_EVERY_NS, now
        self._commanded = min(self._commanded + max(0, stall), now)
        if stall > 0 and self._gone is None:
            self._stood = stall + (self._stood if self._heard <= self._went_on else 0)
            self._went_on = now
        if self._topic is None:
            return None
        if self._is_connected(self._topic):
            self._gone = None
            return None
        if self._gone is None:
            self._gone, self._was_moving = now, is_moving
        if now - self._gone < _GONE_AFTER_NS:
            return None
        topic, self._topic = self._topic, None
        left_motion = self._was_moving or self._was_under_way(self._gone)
        if not left_motion and {*self._process[:1]}.isdisjoint(self._transport.lost(topic)):
            return None
        return self._process[0] if self._process else "the program that moved it"


def _two_robots(topic: str, processes: Iterable[str]) -> str:
    names = " and ".join(sorted(process.partition(" ")[0] for process in processes))
    return f"{topic} is published by {names}: two robots of one name would both obey; end one"


def another_robot(transport: Transport, topics: Sequence[str]) -> str:
    """Return who else publishes one of the topics of joints that this program serves, in words; empty: nobody."""
    others = {topic: transport.other_publishers(topic) for topic in topics}
    return next((_two_robots(*entry) for entry in others.items() if entry[1]), "")


def require_no_other_robot(transport: Transport, topics: Sequence[str]) -> None:
    """Refuse to serve joints that somebody publishes; one that is silent may have crashed, and is waited for."""
    end = transport.steady() + transport.lapses[-1] + SECOND
    heard: list[Subscription] = []
    while other := another_robot(transport, topics):
        if not heard:
            heard = [transport.subscribe(topic, JOINT_STATE) for topic in topics]
        if transport.steady() >= end or any(len(one) for one in heard):
            raise TransportError(other)
        transport.sleep(0.1)
    for one in heard:
        one.close()


def require_one_robot(transport: Transport, joints: Latest) -> None:
    """Refuse to move an arm whose joints come from two programs."""
    now = transport.steady()
    lately = frozenset(process for process, time in tuple(joints.senders.items()) if 0 <= now - time < _UNDER_WAY_NS)
    if "" in lately:  # the transport does not tell
        lately = transport.other_publishers(joints.topic)
    # by address: DDS may learn a name late
    robots = {process.rpartition(" ")[2]: process for process in sorted(lately, reverse=True)}
    if len(robots) > 1:
        raise TransportError(_two_robots(joints.topic, robots.values()))
