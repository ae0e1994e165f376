"""Clocks that were set while their stamps were recorded: the stamps put back onto the clock of the first message.

The time between two messages is the lesser of what stamps and arrivals say of it, where that is not negative. Stamps
that go back or forth by more than that, and stay so, are those of a clock that was set. Messages that were late, lost
or out of order, and connections that stood still, leave the stamps alone.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.recording.topics import SECOND

Stamps = NDArray[np.int64]
STEP = SECOND // 4  # [ns] the least; what is smaller costs no more than as many stamps that repeat
SAME = SECOND // 50  # [ns] within which topics agree on one and the same step
NEAR = 2 * SECOND  # [ns] within which they see it
LEAST = 3  # messages that have to stay where the clock is
CRAWL, APART = (
    1000,
    SECOND // 10_000,
)  # [ns] stamps that creep on, to stay in order, while messages come further apart


class ClockStep(NamedTuple):
    """A clock that was set."""

    at: int  # [ns] arrival of the first message behind it
    by: int  # [ns]; of stamps that stand still by how much it is at least

    def note(self, start: int) -> str:
        """Return this in words; `start` is the arrival of the first message [ns]."""
        after, by = (self.at - start) / SECOND, self.by / SECOND
        return f"its clock was set by {by:+.3f} s, {after:.1f} s after the first message"


def without_steps(
    stamp: Stamps, arrival: Stamps, known: Sequence[ClockStep] = ()
) -> tuple[Stamps, tuple[ClockStep, ...]]:
    """Return stamps as the clock of the first message would have given them, and the steps that were taken out.

    What a step was by is known as well as arrivals follow stamps (the median of their difference), and taken from
    `known` where another topic saw the same one: so topics stay as near to one another as they were stamped.

    Args:
        stamp: (M,) [ns] in the order of arrival.
        arrival: (M,) [ns] by any clock; where both go back, and into stamps that were there, both were set.
        known: Steps of other topics.
    """
    if len(stamp) < 2 * LEAST:
        return stamp, ()
    arrival = _steady(stamp, arrival)
    stamp, steps = _awake(stamp, arrival)
    places = np.flatnonzero(np.abs(np.diff(stamp) - _elapsed(stamp, arrival)) > STEP) + 1
    ends = [0, *places.tolist(), len(stamp)]
    stretches = [(b, e) for b, e in pairwise(ends) if e - b >= LEAST]
    usual = int(np.median((arrival - stamp)[slice(*stretches[0])])) if stretches else 0
    for begin, end in stretches[1:]:
        by = usual - int(
            np.median((arrival - stamp)[begin:end])
        )  # a clock that is ahead makes messages come early
        if abs(by) > STEP:
            shared = [
                one.by for one in known if abs(one.by - by) < SAME and abs(one.at - arrival[begin]) < NEAR
            ]
            by = shared[0] if shared else by
            stamp = np.concatenate([stamp[:begin], stamp[begin:] - by])
            steps = (*steps, ClockStep(int(arrival[begin]), by))
    return stamp, steps


def _elapsed(stamp: Stamps, arrival: Stamps) -> Stamps:
    """Return the time between messages (M - 1,): the lesser, if one is negative the other, if both are the usual."""
    by_stamp, by_arrival = np.diff(stamp), np.diff(arrival)
    usual = int(np.median(np.abs(by_stamp)))
    lesser, greater = np.minimum(by_stamp, by_arrival), np.maximum(by_stamp, by_arrival)
    return np.where(lesser >= 0, lesser, np.where(greater >= 0, greater, usual))


def _steady(stamp: Stamps, arrival: Stamps) -> Stamps:
    """Return arrivals by a clock that was not set back.

    Files that are read in another order than they were recorded in go back, too, but never into what was there.
    """
    places = np.flatnonzero(np.diff(arrival) < -STEP) + 1
    if len(places) == 0:
        return arrival
    elapsed, ends = _elapsed(stamp, arrival), [0, *places.tolist(), len(stamp)]
    arrival = arrival.copy()
    for before, begin, end in zip(ends[:-2], ends[1:-1], ends[2:], strict=True):
        both = stamp[begin] < stamp[begin - 1] - STEP
        if not both or stamp[begin:end].max() >= stamp[before:begin].min():
            arrival[begin:] += arrival[begin - 1] + elapsed[begin - 1] - arrival[begin]
    return arrival


def _awake(stamp: Stamps, arrival: Stamps) -> tuple[Stamps, tuple[ClockStep, ...]]:
    """Return stamps that do not stand still, as those of a program do that never lets them go back."""
    ahead = np.diff(stamp)
    creeps = (ahead > 0) & (ahead <= CRAWL) & (np.diff(arrival) > APART)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], creeps, [False]]).astype(np.int8)))
    steps: tuple[ClockStep, ...] = ()
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if last - first < LEAST or first == 0:
            continue
        stamp = stamp.copy() if not steps else stamp
        rows = slice(first + 1, last + 1)
        awake = arrival[rows] - int(np.median(arrival[: first + 1] - stamp[: first + 1]))
        steps = (*steps, ClockStep(int(arrival[first + 1]), int(stamp[last] - awake[-1])))
        stamp[rows] = awake
    return stamp, steps
