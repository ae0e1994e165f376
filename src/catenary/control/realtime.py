"""Deadlines kept on an operating system that does not guarantee them."""

import gc
import math
import time
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np

from catenary.operating_system import take_priority

_SPIN_S = 2e-4  # [s] before a deadline; sleeping is up to 0.3 ms late here, spinning 1 us
_PRIORITY = 40  # below 50, that of interrupt threads, which bring the robot's messages
_PER_DECADE = 231  # bins of a histogram: 1 % wide
_SHORTEST = 1e-9  # [s]
_BINS = 12 * _PER_DECADE  # up to 1000 s


class Timing(NamedTuple):
    """Quantiles of durations [s], to 1 %."""

    median: float
    p99: float
    p999: float
    max: float

    def in_us(self) -> dict[str, float]:
        """Return plain data in microseconds."""
        return {name: 1e6 * value for name, value in self._asdict().items()}


class Durations:
    """Distribution of any number of durations in fixed memory."""

    def __init__(self) -> None:
        self._counts = [0] * _BINS
        self._max = 0.0

    def add(self, seconds: float) -> None:
        """Count a duration [s] of zero or more."""
        place = int(math.log10(seconds / _SHORTEST) * _PER_DECADE) if seconds > _SHORTEST else 0
        self._counts[min(place, _BINS - 1)] += 1
        self._max = max(self._max, seconds)

    def timing(self) -> Timing | None:
        """Return the quantiles; None when nothing was counted."""
        seen = np.cumsum(self._counts)
        if seen[-1] == 0:
            return None
        places = np.searchsorted(seen, seen[-1] * np.array([0.5, 0.99, 0.999]))
        ends = _SHORTEST * 10.0 ** ((places + 1) / _PER_DECADE)
        median, p99, p999 = np.minimum(ends, self._max).tolist()
        return Timing(median, p99, p999, self._max)


class RealTime:
    """Deadlines at a fixed period, and a process that is disturbed as little as may be.

    `begin` asks for real-time priority (SCHED_FIFO, where that is allowed), freezes what the garbage collector knows
    and switches it off: a full collection takes 66 ms. `end` restores both.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.jitter = Durations()  # difference between the time of a tick and the period
        self.overruns = 0
        self.longest_gap = 0.0  # [s] between two commands
        self.has_priority = False
        self._deadline = self._woken = 0.0
        self._sent = math.inf
        self._before = ExitStack()  # restores what `begin` changed

    def begin(self) -> None:
        """Take priority and quieten the garbage collector."""
        if gc.isenabled():
            self._before.callback(gc.enable)
        if gc.get_freeze_count() == 0:  # objects frozen by others are indistinguishable from ours
            gc.collect()
            gc.freeze()
            self._before.callback(gc.unfreeze)
        gc.disable()
        if (give_back := take_priority(_PRIORITY)) is not None:  # without it slower to wake, no worse
            self._before.callback(give_back)
            self.has_priority = True

    def end(self) -> None:
        """Restore priority and garbage collector."""
        self._before.close()

    def sent(self) -> None:
        """Take the time of a command."""
        last, self._sent = self._sent, time.perf_counter()
        self.longest_gap = max(self.longest_gap, self._sent - last)

    def start(self) -> None:
        """Start the clock: the next deadline is a period away."""
        self._woken = time.perf_counter()
        self._deadline = self._woken + self.period

    def wait(self) -> None:
        """Sleep, then spin, to the deadline; one that has passed is an overrun, and the clock restarts."""
        now = time.perf_counter()
        if now > self._deadline:
            self.overruns += 1
            self._deadline = now
        elif self._deadline - now > _SPIN_S:
            time.sleep(self._deadline - now - _SPIN_S)
        while now < self._deadline:
            now = time.perf_counter()
        self.jitter.add(abs(now - self._woken - self.period))
        self._woken = now
        self._deadline += self.period
