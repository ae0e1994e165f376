"""Time that passes only in sleeps, in which something happens at a fixed period; and that somebody may set."""

import threading

from catenary.crtk.transport import Clock
from catenary.topics import SECOND

BEGIN = 1_700_000_000 * SECOND  # a time of day


class SetClock(Clock):
    """Time that passes only when somebody sleeps, a second of simulation in no second; a clock of the day that somebody
    sets by `ahead` [ns].
    """

    def __init__(self, start: int = BEGIN) -> None:
        self._now = self._start = self._ahead = start
        self.ahead = 0
        self._lock = threading.Lock()

    def now(self) -> int:
        return self._now + self.ahead

    def elapsed(self) -> int:
        return self._now - self._start

    def sleep(self, seconds: float) -> None:
        with self._lock:
            self._now += max(0, round(seconds * SECOND))


class TickingClock(SetClock):
    """While somebody sleeps, `tick` is called whenever a period is over, at that time."""

    def __init__(self, period: float, start: int = BEGIN) -> None:
        super().__init__(start)
        self._period = round(period * SECOND)
        self._next = self.steady() + self._period

    def tick(self) -> None:
        """Do what is due."""

    def sleep(self, seconds: float) -> None:
        end = self.steady() + max(0, round(seconds * SECOND))
        while self._next <= end:
            super().sleep((self._next - self.steady()) / SECOND)
            self._next += self._period
            self.tick()
        super().sleep((end - self.steady()) / SECOND)
