"""Time that passes only in sleeps, and in which something happens at a fixed period."""

from catenary.crtk.clock import SECOND, ManualClock


class TickingClock(ManualClock):
    """While somebody sleeps, `tick` is called whenever a period is over, at that time."""

    def __init__(self, period: float, start: int = SECOND) -> None:
        super().__init__(start)
        self._period = round(period * SECOND)
        self._next = self.now() + self._period

    def tick(self) -> None:
        """Do what is due."""

    def sleep(self, seconds: float) -> None:
        end = self.now() + max(0, round(seconds * SECOND))
        while self._next <= end:
            super().sleep((self._next - self.now()) / SECOND)
            self._next += self._period
            self.tick()
        super().sleep((end - self.now()) / SECOND)
