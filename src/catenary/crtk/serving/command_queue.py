"""Commands that wait for their tick: increments, each obeyed once, and goals that are followed by clamped steps."""

from collections import deque

import numpy as np

from catenary.arrays import Floats

# messages of one tick that are added up; more than two clients at 1 kHz send, so that a backlog gets shorter
MOST_A_TICK = 4
BACKLOG = 0.25  # [s] that an increment waits at most
FOLLOW = 0.1  # [s] after its last command during which a goal, a velocity or a torque counts: the watchdog


class Increments:
    """Increments of any number of clients, summed as they come.

    A message is a millisecond's worth of motion, so each is clamped to what a joint may move in one. What comes within
    a tick is added up as long as the sum stays within that clamp, at most four messages; the rest waits for the next
    ticks. So however messages bunch up on their way, the way they make together is the same, and nothing leaps. The
    robot itself clamps the sum and loses the rest.
    """

    def __init__(self, most: Floats, period: float) -> None:
        """Begin empty.

        Args:
            most: (n,) largest motion in a tick [rad|m].
            period: [s] of a tick.
        """
        self._most = most
        self._patience = max(1, round(BACKLOG / period))
        self._waiting: deque[tuple[Floats, int]] = deque()

    def __len__(self) -> int:
        """How many wait."""
        return len(self._waiting)

    def add(self, dq: Floats, tick: int) -> None:
        """Take in a message's increments (n,) [rad|m], which came in a tick."""
        self._waiting.append((np.minimum(np.maximum(dq, -self._most), self._most), tick))

    def next(self, tick: int) -> Floats | None:
        """Return what to move in a tick (n,) [rad|m], or None."""
        waiting = self._waiting
        while waiting and tick - waiting[0][1] > self._patience:
            waiting.popleft()
        if not waiting:
            return None
        total = waiting.popleft()[0]
        for _ in range(min(MOST_A_TICK - 1, len(waiting))):
            more = total + waiting[0][0]
            if (np.abs(more) > self._most).any():
                break
            waiting.popleft()
            total = more
        return total

    @property
    def total(self) -> Floats:
        """Sum of all that waits (n,) [rad|m]."""
        total: Floats = np.sum([dq for dq, _ in self._waiting], axis=0)
        return total

    def clear(self) -> None:
        """Forget what waits."""
        self._waiting.clear()


class Goal:
    """A joint position that is approached by clamped steps: so many as there were messages, or for a while."""

    def __init__(self, most: Floats, period: float) -> None:
        """Begin without a goal.

        Args:
            most: (n,) largest step in a tick [rad|m].
            period: [s] of a tick.
        """
        self.follow = max(1, round(FOLLOW / period))  # ticks
        self._most = most
        self._q: Floats | None = None
        self._steps = 0

    def __bool__(self) -> bool:
        return self._q is not None

    def set(self, q: Floats, steps: int) -> None:
        """Take a goal (n,) [rad|m] in place of the last one, for a number of steps."""
        self._q, self._steps = q, steps

    def add(self, q: Floats) -> None:
        """Take a goal that allows one step more; those that the last one has left remain."""
        self._q, self._steps = q, min(self._steps + 1, self.follow)

    def next(self, setpoint: Floats) -> Floats:
        """Return the next setpoint (n,) on the way from one."""
        assert self._q is not None
        way = self._q - setpoint
        step = np.minimum(np.maximum(way, -self._most), self._most)
        self._steps -= 1
        if self._steps <= 0 or (step == way).all():
            self._q, self._steps = None, 0
        moved: Floats = setpoint + step
        return moved

    def clear(self) -> None:
        """Forget the goal."""
        self._q, self._steps = None, 0
