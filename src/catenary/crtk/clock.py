"""Clocks of transports: the machine's, or one that a test or a simulator moves on."""

import time

from catenary.errors import InputError
from catenary.operating_system import elapsed_ns

SECOND = 1_000_000_000  # [ns]
_READING_NS = SECOND // 1000  # [ns] that two readings of clocks are apart at most


class Clock:
    """The machine's own time, which is what transports keep to unless they are given another."""

    def __init__(self) -> None:
        self._ahead = 0
        self._ahead = self.set_by()

    def now(self) -> int:
        """Return the time of day [ns since 1970], which may be set back and forth."""
        return time.time_ns()

    def steady(self) -> int:
        """Return the time of day [ns since 1970], ignoring changes to the clock since this object was created."""
        return self._ahead + self.elapsed()

    def set_by(self) -> int:
        """Return the offset by which the time of day was set since construction [ns], negative if back."""
        while True:
            before, now, after = self.elapsed(), self.now(), self.elapsed()
            if after - before < _READING_NS:  # else this program stood still in between
                return now - self._ahead - (before + after) // 2

    def elapsed(self) -> int:
        """Return the time [ns] since an arbitrary moment, which only grows, also while the computer is suspended."""
        return elapsed_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep for some seconds; return at once if not positive."""
        if seconds > 0.0:
            time.sleep(seconds)


class Rate:
    """Paces a loop on a grid; `late` counts ticks a period late or more: missed ones are not made up for."""

    def __init__(self, clock: Clock, hertz: float) -> None:
        if not 0.0 < hertz < float("inf"):
            raise InputError(f"rate: expected a positive number of Hz, got {hertz}")
        self._clock = clock
        self._period = SECOND / hertz
        self._begin, self._ticks = clock.elapsed(), 0
        self.late = 0

    def sleep(self) -> None:
        """Sleep until the next tick."""
        self._ticks += 1
        left = self._begin + self._ticks * self._period - self._clock.elapsed()
        if left > 0.0:
            self._clock.sleep(left / SECOND)
        elif left <= -self._period:
            self.late += 1
            self._begin, self._ticks = self._clock.elapsed(), 0
