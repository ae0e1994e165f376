"""Who moves a served arm, and what becomes of the arm when that program is gone: it holds, and is paused."""

from catenary.crtk.clock import SECOND
from catenary.crtk.holder import UNDER_WAY, held_by
from catenary.crtk.transport import Transport
from catenary.errors import RobotHeldError

LATE = 2 * SECOND  # [ns] that a lease which has run out is noticed late, at most
GONE = 3 * SECOND  # [ns] without its connection: one that breaks is made again within a second or two


class Commander:
    """The program that moved an arm last; whoever can do so, where the transport does not tell programs apart.

    One that goes in the middle of a motion, killed or ended, leaves an arm that nobody moves: its setpoint stays, by
    the watchdog of its commands, and after three seconds the arm is to be paused. A program that let its arm rest
    before it went, and one that is still connected and says nothing, change nothing; neither does one that another has
    followed. While one moves the arm, and for half a second after its last command, what others command is refused.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._topic: str | None = None  # that it commanded by
        self._process: tuple[str, ...] = ()  # its name and address; none where the transport does not tell
        self._commanded = 0  # [ns]
        self._gone: int | None = None  # [ns] when it was first seen to be gone

    def commands(self, topic: str, process: str, now: int) -> None:
        """Note a motion command that was obeyed, at `now` [ns]; `process` as in `Arrival.process`."""
        self._topic, self._process = topic, tuple(process.split())
        self._commanded, self._gone = now, None

    def require_free(self, process: str, now: int, *, is_moving: bool) -> None:
        """Refuse the command of a program while another one moves the arm.

        Args:
            process: As in `Arrival.process`; one that is not known is never refused.
            now: [ns].
            is_moving: Whether a move of the arm's own is under way.

        Raises:
            RobotHeldError: The message has both names.
        """
        name = process.partition(" ")[0]  # a network has one program of a name
        if self._topic is None or not self._process or name in ("", self._process[0]):
            return
        if is_moving or 0 <= now - self._commanded < UNDER_WAY:
            raise RobotHeldError(held_by(name, self._process[0], self._topic))

    def forget(self) -> None:
        """Know of nobody, as when the arm is not enabled."""
        self._topic = None

    def _was_under_way(self, now: int) -> bool:
        """Return whether a program that is seen to be gone moved the arm at its end, whenever that was."""
        since = now - self._commanded
        return any(
            0 <= since < UNDER_WAY if lapse == 0 else lapse - UNDER_WAY <= since < lapse + LATE
            for lapse in self._transport.lapses
        )

    def left(self, now: int, *, is_moving: bool) -> str | None:
        """Return who has left the arm in the middle of a motion for too long, once; called some ten times a second.

        Args:
            now: [ns].
            is_moving: Whether a move of the arm's own is under way.
        """
        if self._topic is None:
            return None
        connected = self._transport.connections(self._topic).publishers
        if {*self._process} & {*connected} if self._process else connected:
            self._gone = None
            return None
        if self._gone is None:
            if not (is_moving or self._was_under_way(now)):
                self._topic = None
                return None
            self._gone = now
        if now - self._gone < GONE:
            return None
        self._topic = None
        return self._process[0] if self._process else "the program that moved it"
