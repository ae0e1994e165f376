"""Which other program moves an arm: heard on the arm's own command topics, before a client begins to move it."""

from catenary.crtk.clock import SECOND
from catenary.crtk.inbox import Subscription
from catenary.crtk.names import COMMAND, WARNING, Dialect, topics_of
from catenary.crtk.transport import Transport
from catenary.errors import RobotHeldError
from catenary.recording.topics import Arm

UNDER_WAY = SECOND // 2  # [ns] from a program's last command until it is no longer taken to be moving the arm
LISTEN = 0.35  # [s] that a client listens before it begins
HELD = "holds the arm"


def held_by(refused: str, holder: str, topic: str) -> str:
    """Return what a served arm says of a program whose command it refused, because another moves the arm."""
    return f"{refused} has to wait: {holder} {HELD} ({topic})"


class OtherCommanders:
    """Hears who else commands an arm, until its own client does; from then on what the robot says of it."""

    def __init__(self, transport: Transport, dialect: Dialect, arm: Arm, namespace: str | None) -> None:
        """Begin to listen."""
        self._transport = transport
        self._heard: list[Subscription] = []
        self._last: tuple[str, str, int] | None = None  # program, topic, arrival [ns]
        self._told: Subscription | None = None
        self._refused: str | None = None
        for topic in topics_of(dialect, arm, namespace):
            if topic.direction == "in" and topic.type != COMMAND and topic.verb not in ("hold", "free"):
                self._heard.append(transport.subscribe(topic.name, topic.type, depth=1))
            elif topic.verb == WARNING:
                self._told = transport.subscribe(topic.name, topic.type, depth=20)

    def listen(self, seconds: float = LISTEN) -> None:
        """Listen for a while, for the last time: what follows is the robot's to say."""
        if self._heard:
            self._transport.sleep(seconds)
            self.require_none()
            self.we_command()

    def require_none(self) -> None:
        """Look at what has come."""
        for heard in self._heard:
            for one in heard.take_arrivals():
                program = one.process.partition(" ")[0]
                if program and program.rpartition("/")[2] != self._transport.name:
                    self._last = program, heard.topic, one.time
        now = self._transport.steady()
        if self._last is not None and 0 <= now - self._last[2] < UNDER_WAY:
            program, topic, time = self._last
            raise RobotHeldError(
                f"{program} {HELD}: it commanded {topic} {(now - time) / SECOND:.2f} s ago; "
                "end it first, nothing has moved"
            )
        if self._told is not None and len(self._told):
            for message, _ in self._told.take():
                self._read_warning(message.data)

    def we_command(self) -> None:
        """Note that the own client moves the arm; only the robot is listened to then."""
        if self._heard:
            for heard in self._heard:
                heard.close()
            self._heard = []

    def close(self) -> None:
        """Hear no more."""
        self.we_command()
        if self._told is not None:
            self._told.close()

    def _read_warning(self, text: str) -> None:
        said, is_held, _ = text.partition(f" {HELD}")
        refused, _, holder = said.rpartition(" has to wait: ")
        if is_held and refused.rpartition(" ")[2].rpartition("/")[2] == self._transport.name:
            raise RobotHeldError(f"{holder} {HELD}; the robot refused this program's commands")
