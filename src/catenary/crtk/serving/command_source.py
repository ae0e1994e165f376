"""Commands of one topic, as a server takes them in: fresh ones only.

Two kinds of old commands reach a server. Stamped ones that were held up say so by their stamp. Latched ones, which a
living client sent to a robot that has since been restarted, come at once when the new server connects, most of them
without a stamp (CRTK's Python client and the RAVEN-II's latch and do not stamp). So a topic that somebody published
before the server began is not obeyed until a second after the connection, unless a stamp says that the command is
newer than the server. A program that was not among those publishers is obeyed at once, where the transport tells
programs apart: ROS 1's master goes on listing clients that crashed. DDS tells when a message was sent: a latched one
that comes first and was sent half a second ago or more is old. Should an old client be out of reach for longer,
what it first says when it is back is latched too. And when a connection breaks and is made again, the publisher gives
once more what it said last: that is dropped by the transport (`Subscription.repeated`); something else, said while
the connection was broken, is of unknown age, and is obeyed with a fresh stamp only. `disable` and `pause` are obeyed
at any time.
"""

from collections.abc import Set

from catenary.crtk.exclusive_control import STOPPING_COMMANDS
from catenary.crtk.message import stamp_of
from catenary.crtk.message_queues import Arrival
from catenary.crtk.serving.reports import Reports
from catenary.crtk.topic_names import COMMAND, CrtkTopic
from catenary.crtk.transport import Transport
from catenary.topics import SECOND

_OLDEST_STAMP_NS = SECOND // 2  # [ns] age of a stamp beyond which a command is not obeyed
# [ns] the same of the state command by which a program begins that came after this server: over DDS it may take seconds
# until both have found each other, and the program waits for the answer
_FIRST_NS = 5 * SECOND
_SETTLE_NS = SECOND  # [ns] after a connection to a client that was there before the server
_DEAD_CLIENT_NS = 10 * SECOND  # [ns] for such a connection, where the client turns out to be dead
_COMMAND_BYTES = 2048  # bytes of a command that is looked at, ours: what is larger costs a tick its time
_ALWAYS_OBEYED = (*STOPPING_COMMANDS, "console/power_off")
# tenths of a millisecond that a command takes at most: inverse kinematics, of two arms
_COSTS = {
    "geometry_msgs/PoseStamped": 3,
    "geometry_msgs/TransformStamped": 3,
    "geometry_msgs/TwistStamped": 3,
    "raven_2/raven_automove": 4,
}
TOPIC_COMMANDS_A_TICK = 4  # messages that are looked at in a tick: two clients at 1 kHz, and as many again of a backlog


class CommandSource:
    """Fresh commands of one topic."""

    def __init__(
        self, transport: Transport, topic: CrtkTopic, reports: Reports, *, begin: int, waits: bool, old: Set[str]
    ) -> None:
        """Begin at a time [ns]; it `waits` where the topic was published then, by `old` processes if known."""
        self.topic = topic
        self._transport = transport
        self._reports = reports
        self._begin, self._waits, self._old = begin, waits, old
        self._set = 0  # [ns] by which the clock of the day has been set
        self._connected: int | None = None
        self._since: dict[str, int] = {}  # [ns] when programs were first seen to be connected
        self._subscription = transport.subscribe(topic.name, topic.type, largest=_COMMAND_BYTES)
        self._missed = self._oversized = 0
        self.cost = _COSTS.get(topic.type, 1)
        self.moves = topic.moves
        self.heard: dict[str, int] = {}  # by `Arrival.process`, when its newest came [ns], of all that were taken last

    def __len__(self) -> int:
        return len(self._subscription)

    def forget(self) -> int:
        """Drop what waits, and return how many commands that were."""
        return self._subscription.forget()

    def take(self, now: int, limit: int = TOPIC_COMMANDS_A_TICK) -> list[Arrival]:
        """Return those commands that are fresh of the `limit` that have waited longest, oldest first; `now` in ns."""
        came = self._subscription.take_arrivals(limit=limit)
        self._set, self.heard = self._transport.clock.set_by(), {one.process: one.time for one in came}
        self._report_lost(now)
        return [one for one in came if self._is_fresh(one, now)]

    def _report_lost(self, now: int) -> None:
        heard = self._subscription
        lost = heard.overflowed + heard.damaged
        if lost > self._missed:
            self._reports.say(f"{self.topic.name}: lost", f"{lost - self._missed} commands", now)
            self._missed = lost
        if heard.oversized > self._oversized:
            text = f"{heard.oversized - self._oversized} commands of more than {_COMMAND_BYTES} bytes dropped"
            to = () if self.topic.arm is None else (self.topic.arm,)
            self._reports.say(f"{self.topic.name}: too large", text, now, to=to)
            self._oversized = heard.oversized

    def watch(self, now: int) -> None:
        """Look at who is connected and what was lost; called some ten times a second."""
        self._report_lost(now)
        if not (self._waits or self._old):
            return
        connected = self._transport.connections(self.topic.name).publishers
        for name in connected:
            self._since.setdefault(name, now)
        if not self._waits:
            return
        if self._connected is None and connected:
            self._connected = now
        since, least = (self._begin, _DEAD_CLIENT_NS) if self._connected is None else (self._connected, _SETTLE_NS)
        self._waits = 0 <= now - since < least  # a clock that was set back ends it too

    def _is_fresh(self, arrival: Arrival, now: int) -> bool:
        message = arrival.message
        command = message.string.strip() if self.topic.type == COMMAND else self.topic.verb
        if command in _ALWAYS_OBEYED:
            return True
        stamp = stamp_of(message)
        if stamp:
            stamp -= self._set
            begins = self.topic.commands_state and arrival.is_first and stamp > self._begin
            if now - stamp > (_FIRST_NS if begins and arrival.process not in self._old else _OLDEST_STAMP_NS):
                age = (now - stamp) / SECOND
                self._reports.say(f"{self.topic.name}: old", f"stamped {age:.2f} s ago, not obeyed", now)
                return False
            if stamp > self._begin:
                return True
        name, _, where = arrival.process.partition(" ")
        # a program that is known not to have published the topic when the server began; one that was there before the
        # server, and has been connected for less than a second
        is_newcomer = where and self._old and self._old.isdisjoint((arrival.process, f"{name} "))
        is_from_before = arrival.process in self._old and 0 <= now - self._since.get(name, now) < _SETTLE_NS
        sent = now if arrival.sent is None else arrival.sent - self._set
        if (self._waits and not is_newcomer) or (arrival.is_first and is_from_before):
            kind, reason = "from before", "its client was there before this server"
        elif arrival.is_first and now - sent > _OLDEST_STAMP_NS:
            kind, reason = "old", f"sent {(now - sent) / SECOND:.2f} s before it came"
        elif arrival.is_renewed:
            kind, reason = "after a break", "said while its client was not connected"
        else:
            return True
        text = f"{reason}, so this may be an old command: not obeyed, send it again"
        self._reports.say(f"{self.topic.name}: {kind}", text, now)
        return False
