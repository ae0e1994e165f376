"""Who moves a served arm, and what becomes of the arm when that program is gone: it holds, and is paused."""

from collections.abc import Collection

from catenary.crtk.clock import SECOND
from catenary.crtk.holder import UNDER_WAY, held_by
from catenary.crtk.transport import Transport
from catenary.errors import RobotHeldError

LATE = 2 * SECOND  # [ns] that a lease which has run out is noticed late, at most
GONE = 3 * SECOND  # [ns] without its connection: one that breaks is made again within a second or two
WATCH = SECOND // 10  # [ns] between two looks at who is connected


class Commander:
    """The program that moved an arm last; whoever can do so, where the transport does not tell programs apart.

    One that goes in the middle of a motion, killed or ended, leaves an arm that nobody moves: its setpoint stays, by
    the watchdog of its commands, and after three seconds the arm is to be paused. A program that let its arm rest
    before it ended, and one that is still connected and says nothing, change nothing; neither does one that another has
    followed. While one moves the arm, and for half a second after its last command, what others command is refused.

    A server that stood still (stopped, or on a suspended computer) does not know when in the meantime the program went,
    so that time counts as no rest of the program's; nor does the time in which commands come in that are refused.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._topic: str | None = None  # that it commanded by
        self._process: tuple[str, ...] = ()  # its name and address; none where the transport does not tell
        self._commanded = self._heard = 0  # [ns] its last command that was obeyed, and that came in
        self._looked = self._stood = 0  # [ns] last look, and how long looks have not come since it was heard
        self._gone: int | None = None  # [ns] when it was first seen to be gone
        self._left_motion = False  # by going then

    def commands(self, topic: str, process: str, now: int) -> None:
        """Note a motion command that was obeyed, at `now` [ns]; `process` as in `Arrival.process`."""
        self._topic, self._process = topic, tuple(process.split())
        self._commanded = now
        self.hears((process,), now)

    def hears(self, processes: Collection[str], now: int) -> None:
        """Note that commands of programs came in, whether they are obeyed or not: signs of life of the one that moves.

        Args:
            processes: As in `Arrival.process`.
            now: [ns].
        """
        if self._process in [tuple(one.split()) for one in processes]:
            self._heard = self._looked = now
            self._stood, self._gone = 0, None

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
        most = now - self._heard
        least = most - self._stood
        return any(
            least < (lapse + LATE if lapse else UNDER_WAY) and most >= lapse - UNDER_WAY
            for lapse in self._transport.lapses
        )

    def left(self, now: int, *, is_moving: bool) -> str | None:
        """Return who has left the arm in the middle of a motion for too long, once; called some ten times a second.

        Args:
            now: [ns].
            is_moving: Whether a move of the arm's own is under way.
        """
        self._stood += max(0, now - self._looked - 2 * WATCH)
        self._looked = now
        if self._topic is None:
            return None
        connected = self._transport.connections(self._topic).publishers
        if {*self._process} & {*connected} if self._process else connected:
            self._gone = None
            return None
        if self._gone is None:
            self._gone, self._left_motion = now, is_moving or self._was_under_way(now)
        if now - self._gone < GONE:
            return None
        topic, self._topic = self._topic, None
        if not self._left_motion and {*self._process[:1]}.isdisjoint(self._transport.lost(topic)):
            return None
        return self._process[0] if self._process else "the program that moved it"
