"""Time that passes only in sleeps, in which something happens at a fixed period; and that somebody may set."""

from catenary.crtk.clock import SECOND, ManualClock


class TickingClock(ManualClock):
    """While somebody sleeps, `tick` is called whenever a period is over, at that time."""

    def __init__(self, period: float, start: int = SECOND) -> None:
        super().__init__(start)
        self._period = round(period * SECOND)
        self._next = self.steady() + self._period
        self.ahead = 0  # [ns] by which the time of day has been set

    def now(self) -> int:
        return super().now() + self.ahead

    def tick(self) -> None:
        """Do what is due."""

    def sleep(self, seconds: float) -> None:
        end = self.steady() + max(0, round(seconds * SECOND))
        while self._next <= end:
            super().sleep((self._next - self.steady()) / SECOND)
            self._next += self._period
            self.tick()
        super().sleep((end - self.steady()) / SECOND)
