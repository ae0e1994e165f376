"""Time stamps of a board's samples on the host's clock."""

WRAP = 2**32  # [us] at which a board's clock begins anew: every 71.6 minutes
DRIFT = 0.01  # by which the clocks may run apart; ceramic resonators are good to 0.005
RESTART = 10.0  # [s] of a leap that means that the board was restarted


class BoardClock:
    """Turns a board's microseconds into the host's seconds.

    A sample never arrives before it was taken, and now and then with hardly any delay: the smallest difference
    between arrival and board time is the offset of the clocks. It may grow by DRIFT, so that a slow board is
    followed too. What is left is the smallest delay of the line, a millisecond or two over USB, and constant.
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._elapsed = 0.0  # [s] on the board's clock since it was first heard
        self._offset = 0.0
        self.restarts = 0

    def stamp(self, micros: int, arrival: float) -> float:
        """Return a sample's time [s] on the host's clock, from the board's [us], modulo 2^32, and its arrival [s]."""
        if self._last is None:
            self._begin(arrival)
        else:
            step = (micros - self._last) % WRAP * 1e-6
            if step > RESTART:  # back, or far ahead
                self.restarts += 1
                self._begin(arrival)
            else:
                self._elapsed += step
                self._offset = min(self._offset + DRIFT * step, arrival - self._elapsed)
        self._last = micros
        return self._offset + self._elapsed

    def _begin(self, arrival: float) -> None:
        self._elapsed = 0.0
        self._offset = arrival
