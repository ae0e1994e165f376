"""Commands of one topic, as a server takes them in: fresh ones only.

Two kinds of old commands reach a server. Stamped ones that were held up say so by their stamp. Latched ones, which a
living client sent to a robot that has since been restarted, come at once when the new server connects, most of them
without a stamp (CRTK's Python client and the RAVEN-II's latch and do not stamp). So a topic that somebody published
before the server began is not obeyed until a second after the connection, unless a stamp says that the command is
newer than the server. `disable` and `pause` are obeyed at any time.
"""

from typing import NamedTuple

from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, stamp_of
from catenary.crtk.names import COMMAND, CrtkTopic
from catenary.crtk.reports import Reports
from catenary.crtk.transport import Transport

OLDEST = SECOND // 2  # [ns] age of a stamp beyond which a command is not obeyed
SETTLE = SECOND  # [ns] after a connection to a client that was there before the server
LONGEST_WAIT = 10 * SECOND  # [ns] for such a connection, where the client turns out to be dead
ALWAYS_OBEYED = ("disable", "pause")
_NOTHING: list[Message] = []


class Beginning(NamedTuple):
    """When a server began, and who was there before it."""

    time: int  # [ns]
    published: frozenset[str]  # topics


class CommandSource:
    """Fresh commands of one topic."""

    def __init__(
        self, transport: Transport, topic: CrtkTopic, beginning: Beginning, reports: Reports
    ) -> None:
        """Subscribe.

        Raises:
            TransportError: The topic carries another type.
        """
        self.topic = topic
        self._transport = transport
        self._reports = reports
        self._begin = beginning.time
        self._connected: int | None = None
        self._waits = topic.name in beginning.published
        self._subscription = transport.subscribe(topic.name, topic.type)
        self.waiting = self._subscription.__len__  # asked every millisecond, of two dozen topics
        self._missed = 0

    def take(self, now: int) -> list[Message]:
        """Give the fresh commands that came since the last time, oldest first; `now` in ns."""
        if not len(self._subscription):
            return _NOTHING
        fresh = [one.message for one in self._subscription.take() if self._is_fresh(one.message, now)]
        lost = self._subscription.overflowed + self._subscription.damaged
        if lost > self._missed:
            self._reports.say(f"{self.topic.name}: lost", f"{lost - self._missed} commands", now)
            self._missed = lost
        return fresh

    def watch(self, now: int) -> None:
        """Look at who is connected; called some ten times a second."""
        if not self._waits:
            return
        if self._connected is None and self._transport.connections(self.topic.name).publishers:
            self._connected = now
        since, least = (self._begin, LONGEST_WAIT) if self._connected is None else (self._connected, SETTLE)
        self._waits = 0 <= now - since < least  # a clock that was set back ends it too

    def _is_fresh(self, message: Message, now: int) -> bool:
        if self.topic.type == COMMAND and message.string.strip() in ALWAYS_OBEYED:
            return True
        stamp = stamp_of(message)
        if stamp:
            if now - stamp > OLDEST:
                age = (now - stamp) / SECOND
                self._reports.say(f"{self.topic.name}: old", f"stamped {age:.2f} s ago, not obeyed", now)
                return False
            if stamp > self._begin:
                return True
        if self._waits:
            self._reports.say(
                f"{self.topic.name}: from before",
                "its client was there before this server, so this may be an old command: not obeyed, send it anew",
                now,
            )
            return False
        return True
