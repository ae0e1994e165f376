"""Samples with stamps: put in order, measured for gaps, read between neighbours, steps of their clock taken out.

The time between two messages is the lesser of what stamps and arrivals say of it, where that is not negative. Integers
that go back or forth by more than that, and stay so, are those of a clock that was set. Messages that were late, lost
or out of order, and connections that stood still, leave the stamps alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, Integers
from catenary.errors import InputError
from catenary.topics import SECOND

GAP_INTERVALS = 3.0  # intervals that a gap is long, at least; a slow topic has no gaps merely for being slow
_NOTED_OFFSET_S = 0.005  # [s] of a clock against the arrival of messages that is worth a note
_MIN_STEP_NS = SECOND // 4  # [ns] the least; what is smaller costs no more than as many stamps that repeat
_SAME_STEP_NS = SECOND // 50  # [ns] within which topics agree on one and the same step
_SAME_TIME_NS = 2 * SECOND  # [ns] within which they see it
_MIN_MESSAGES = 3  # messages that have to stay where the clock is
# [ns] stamps that creep on, to stay in order, while messages come further apart
_CRAWL_NS, _APART_NS = 1000, SECOND // 10_000


class ClockStep(NamedTuple):
    """A clock that was set."""

    at: int  # [ns] arrival of the first message behind it
    by: int  # [ns]; of stamps that stand still by how much it is at least

    def note(self, start: int) -> str:
        """Return this in words; `start` is the arrival of the first message [ns]."""
        after, by = (self.at - start) / SECOND, self.by / SECOND
        return f"its clock was set by {by:+.3f} s, {after:.1f} s after the first message"


@dataclass(frozen=True)
class TopicReport:
    """Rate, gaps and disorder of a topic's messages."""

    topic: str
    messages: int  # as recorded
    rate: float  # [Hz] of what is left, gaps left out; nan for fewer than two
    # [s] where each begins, from the first state message or sample, and its length
    gaps: tuple[tuple[float, float], ...]
    repeated: int  # stamps that were there before; dropped
    shuffled: int  # messages that came after one with a later stamp; sorted
    # [s] median of arrival minus stamp: transport, and what the clocks differ by; nan if unknown
    clock_offset: float
    stamped_by_arrival: bool  # messages carried no stamps
    clock_steps: tuple[ClockStep, ...] = ()  # of the clock of the stamps; taken out of them
    start: int = 0  # [ns] arrival of the first message

    @property
    def longest_gap(self) -> float:
        """Length of the longest gap, 0 for none [s]."""
        return max((length for _, length in self.gaps), default=0.0)

    def notes(self) -> list[str]:
        """Return notes for the user."""
        notes = {
            f"{len(self.gaps)} gap(s), the longest {self.longest_gap:.3f} s": self.gaps,
            f"{self.repeated} repeated stamps were dropped": self.repeated,
            f"{self.shuffled} messages were out of order and sorted": self.shuffled,
            f"stamps lie {self.clock_offset:.3f} s before arrival; not corrected": abs(self.clock_offset)
            > _NOTED_OFFSET_S,
            "messages carry no stamps; their arrival was taken": self.stamped_by_arrival,
        }
        steps = [f"{step.note(self.start)}; stamps continue as before" for step in self.clock_steps]
        return [f"{self.topic}: {text}" for text in [*(text for text, is_so in notes.items() if is_so), *steps]]


@dataclass(frozen=True)
class Series:
    """Samples with stamps that strictly increase."""

    stamp: Integers  # (M,) [ns]
    values: Floats  # (M, k)
    report: TopicReport


def clean_series(
    topic: str,
    stamp: Integers,
    values: NDArray[Any],
    *,
    max_gap: float,  # intervals beyond it, and beyond three median intervals, are gaps [s]
    arrival: Integers | None = None,  # (M,) [ns]; takes the stamps' place where none is set (all are 0)
    span: tuple[int, int] | None = None,  # of the state [ns]; what is missing at its ends counts as a gap
    clock_steps: Sequence[ClockStep] = (),  # that other topics' clocks did
) -> Series:
    """Put samples (M, k) in the order of their stamps [ns], drop stamps that repeat (the first stays), and report."""
    if len(stamp) == 0:
        raise InputError(f"topic {topic}: has no messages")
    unstamped = arrival is not None and not stamp.any() and bool(arrival.any())
    offset, steps = float("nan"), tuple[ClockStep, ...]()
    if arrival is not None and unstamped:
        stamp = arrival
    elif arrival is not None:
        stamp, steps = without_steps(stamp, arrival, clock_steps)
        offset = float(np.median(arrival - stamp)) / SECOND
    shuffled = int((stamp < np.maximum.accumulate(stamp)).sum())
    ordered, repeated = stamp, 0
    if (np.diff(stamp) <= 0).any():  # rarely; long series are not copied for nothing
        order = np.argsort(stamp, kind="stable")
        fresh = np.concatenate([[True], np.diff(stamp[order]) > 0])
        order, repeated = order[fresh], int((~fresh).sum())
        ordered, values = stamp[order], values[order]
    start, end = (ordered[0], ordered[-1]) if span is None else span
    edges = np.concatenate([[min(start, ordered[0])], ordered, [max(end, ordered[-1])]])
    intervals = np.diff(ordered) / SECOND
    limit = max(max_gap, GAP_INTERVALS * float(np.median(intervals))) if len(intervals) else max_gap
    regular = intervals[intervals <= limit]
    wide = np.flatnonzero(np.diff(edges) / SECOND > limit)
    gaps = tuple((float(edges[i] - start) / SECOND, float(edges[i + 1] - edges[i]) / SECOND) for i in wide)
    rate = float(1.0 / regular.mean()) if len(regular) else float("nan")
    began = 0 if arrival is None else int(arrival[0])
    report = TopicReport(topic, len(stamp), rate, gaps, repeated, shuffled, offset, unstamped, steps, began)
    return Series(ordered, np.asarray(values, dtype=np.float64), report)


def interpolate(series: Series, stamp: Integers, max_gap: float) -> Floats:
    """Return values (N, k) on the line between the samples around other stamps; NaN in gaps or where one lacks."""
    right = np.searchsorted(series.stamp, stamp, side="left")
    exact = series.stamp[np.minimum(right, len(series.stamp) - 1)] == stamp
    left = np.where(exact, right, right - 1)
    inside = exact | ((right > 0) & (right < len(series.stamp)))
    left, right = np.where(inside, left, 0), np.where(inside, right, 0)
    width = series.stamp[right] - series.stamp[left]  # whole nanoseconds: no rounding of large stamps
    share = (stamp - series.stamp[left]) / np.maximum(width, 1)
    values = series.values[left] + share[:, None] * (series.values[right] - series.values[left])
    values[~inside | (width > max_gap * SECOND)] = np.nan
    return np.asarray(values)


def without_steps(
    stamp: Integers, arrival: Integers, known: Sequence[ClockStep] = ()
) -> tuple[Integers, tuple[ClockStep, ...]]:
    """Return stamps (M,) [ns] as the clock of the first message would have given them, and the steps taken out.

    What a step was by is known as well as arrivals follow stamps (the median of their difference), and taken from
    `known` where another topic saw the same one: so topics stay as near to one another as they were stamped. Where
    arrivals go back too, and into stamps that were there, both clocks were set.
    """
    if len(stamp) < 2 * _MIN_MESSAGES:
        return stamp, ()
    arrival = _steady(stamp, arrival)
    stamp, steps = _awake(stamp, arrival)
    places = np.flatnonzero(np.abs(np.diff(stamp) - _elapsed(stamp, arrival)) > _MIN_STEP_NS) + 1
    ends = [0, *places.tolist(), len(stamp)]
    stretches = [(b, e) for b, e in pairwise(ends) if e - b >= _MIN_MESSAGES]
    usual = int(np.median((arrival - stamp)[slice(*stretches[0])])) if stretches else 0
    for begin, end in stretches[1:]:
        by = usual - int(np.median((arrival - stamp)[begin:end]))  # a clock that is ahead makes messages come early
        if abs(by) > _MIN_STEP_NS:
            shared = [
                one.by
                for one in known
                if abs(one.by - by) < _SAME_STEP_NS and abs(one.at - arrival[begin]) < _SAME_TIME_NS
            ]
            by = shared[0] if shared else by
            stamp = np.concatenate([stamp[:begin], stamp[begin:] - by])
            steps = (*steps, ClockStep(int(arrival[begin]), by))
    return stamp, steps


def _elapsed(stamp: Integers, arrival: Integers) -> Integers:
    """Return the time between messages (M - 1,): the lesser, if one is negative the other, if both are the usual."""
    by_stamp, by_arrival = np.diff(stamp), np.diff(arrival)
    usual = int(np.median(np.abs(by_stamp)))
    lesser, greater = np.minimum(by_stamp, by_arrival), np.maximum(by_stamp, by_arrival)
    return np.where(lesser >= 0, lesser, np.where(greater >= 0, greater, usual))


def _steady(stamp: Integers, arrival: Integers) -> Integers:
    """Return arrivals by a clock that was not set back; files read in another order never go into what was there."""
    places = np.flatnonzero(np.diff(arrival) < -_MIN_STEP_NS) + 1
    if len(places) == 0:
        return arrival
    elapsed, ends = _elapsed(stamp, arrival), [0, *places.tolist(), len(stamp)]
    arrival = arrival.copy()
    for before, begin, end in zip(ends[:-2], ends[1:-1], ends[2:], strict=True):
        both = stamp[begin] < stamp[begin - 1] - _MIN_STEP_NS
        if not both or stamp[begin:end].max() >= stamp[before:begin].min():
            arrival[begin:] += arrival[begin - 1] + elapsed[begin - 1] - arrival[begin]
    return arrival


def _awake(stamp: Integers, arrival: Integers) -> tuple[Integers, tuple[ClockStep, ...]]:
    """Return stamps that do not stand still, as those of a program do that never lets them go back."""
    ahead = np.diff(stamp)
    creeps = (ahead > 0) & (ahead <= _CRAWL_NS) & (np.diff(arrival) > _APART_NS)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], creeps, [False]]).astype(np.int8)))
    steps: tuple[ClockStep, ...] = ()
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if last - first < _MIN_MESSAGES or first == 0:
            continue
        stamp = stamp.copy() if not steps else stamp
        rows = slice(first + 1, last + 1)
        awake = arrival[rows] - int(np.median(arrival[: first + 1] - stamp[: first + 1]))
        steps = (*steps, ClockStep(int(arrival[first + 1]), int(stamp[last] - awake[-1])))
        stamp[rows] = awake
    return stamp, steps
