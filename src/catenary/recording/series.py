"""One topic's samples in time: put in order, measured for gaps and jitter, interpolated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.recording.clock_steps import ClockStep, without_steps
from catenary.recording.topics import SECOND

WIDE = 3.0  # intervals that a gap is long, at least; a slow topic has no gaps merely for being slow
OFFSET = 0.005  # [s] of a clock against the arrival of messages that is worth a note


@dataclass(frozen=True)
class TopicReport:
    """Rate, jitter, gaps and disorder of a topic's messages."""

    topic: str
    messages: int  # as recorded
    rate: float  # [Hz] of what is left, gaps left out; nan for fewer than two
    jitter: float  # [s] standard deviation of the intervals, gaps left out
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
        """Return what a reader should know, in words."""
        notes = []
        if self.gaps:
            notes.append(f"{self.topic}: {len(self.gaps)} gap(s), the longest {self.longest_gap:.3f} s")
        if self.repeated:
            notes.append(f"{self.topic}: {self.repeated} repeated stamps were dropped")
        if self.shuffled:
            notes.append(f"{self.topic}: {self.shuffled} messages were out of order and sorted")
        if abs(self.clock_offset) > OFFSET:
            notes.append(f"{self.topic}: stamps lie {self.clock_offset:.3f} s before arrival; not corrected")
        if self.stamped_by_arrival:
            notes.append(f"{self.topic}: messages carry no stamps; their arrival was taken")
        notes += [
            f"{self.topic}: {step.note(self.start)}; stamps go on as before it" for step in self.clock_steps
        ]
        return notes


@dataclass(frozen=True)
class Series:
    """Samples with stamps that strictly increase."""

    stamp: NDArray[np.int64]  # (M,) [ns]
    values: Floats  # (M, k)
    report: TopicReport


def clean_series(
    topic: str,
    stamp: NDArray[np.int64],
    values: NDArray[Any],
    *,
    max_gap: float,
    arrival: NDArray[np.int64] | None = None,
    span: tuple[int, int] | None = None,
    clock_steps: Sequence[ClockStep] = (),
) -> Series:
    """Put samples in the order of their stamps, drop repeated stamps (the first to arrive stays), and report.

    Steps of the clock that stamped them are taken out first, by `without_steps`.

    Args:
        topic: Name, for the report.
        stamp: (M,) [ns].
        values: (M, k).
        max_gap: Intervals beyond it, and beyond three median intervals, are gaps [s].
        arrival: (M,) [ns]; takes the stamps' place where none is set (all are 0).
        span: First and last stamp of the state [ns]; what is missing at its ends counts as a gap.
        clock_steps: What other topics' clocks did.
    """
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
    limit = max(max_gap, WIDE * float(np.median(intervals))) if len(intervals) else max_gap
    regular = intervals[intervals <= limit]
    wide = np.flatnonzero(np.diff(edges) / SECOND > limit)
    gaps = tuple((float(edges[i] - start) / SECOND, float(edges[i + 1] - edges[i]) / SECOND) for i in wide)
    report = TopicReport(
        topic=topic,
        messages=len(stamp),
        rate=float(1.0 / regular.mean()) if len(regular) else float("nan"),
        jitter=float(regular.std()) if len(regular) else float("nan"),
        gaps=gaps,
        repeated=repeated,
        shuffled=shuffled,
        clock_offset=offset,
        stamped_by_arrival=unstamped,
        clock_steps=steps,
        start=0 if arrival is None else int(arrival[0]),
    )
    return Series(ordered, np.asarray(values, dtype=np.float64), report)


def interpolate(series: Series, stamp: NDArray[np.int64], max_gap: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Return values at other stamps, on the straight line between the two samples around each.

    Returns:
        Values (N, k), NaN where the neighbours lie further apart than `max_gap` [s] or one is missing, and (N,)
        where they do not. A sample at the very stamp needs no neighbours.
    """
    right = np.searchsorted(series.stamp, stamp, side="left")
    exact = series.stamp[np.minimum(right, len(series.stamp) - 1)] == stamp
    left = np.where(exact, right, right - 1)
    inside = exact | ((right > 0) & (right < len(series.stamp)))
    left, right = np.where(inside, left, 0), np.where(inside, right, 0)
    width = series.stamp[right] - series.stamp[left]  # whole nanoseconds: no rounding of large stamps
    near = inside & (width <= max_gap * SECOND)
    share = (stamp - series.stamp[left]) / np.maximum(width, 1)
    a, b = series.values[left], series.values[right]
    values = a + share[:, None] * (b - a)
    values[~near] = np.nan
    return values, near
