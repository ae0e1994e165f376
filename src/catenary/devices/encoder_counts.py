"""Counts of an encoder board: its lines read, its counters' ends crossed, rows that cannot be true left out."""

import math
import re
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, frozen
from catenary.devices.encoder_rig import JOINTS, EncoderRig
from catenary.errors import InputError

# [s] by which a line may be late; Linux's serial drivers gather what USB brings for 16 ms
LATENESS = 0.02
SLACK = 2  # counts by which an encoder flickers
CONFIRM = 5  # rows in a row that go on from one that leapt, before it is taken for the truth
SILENCE = 1.0  # [s] after which the board may have been restarted: an Arduino takes that long
NEAR_ZERO, FAR = 20, 2000  # counts: all at zero at once, from afar, is a board that began anew
Raw = tuple[int, int, int]
_LINE = re.compile(r"(-?\d{1,10})_(-?\d{1,10})_(-?\d{1,10})", re.ASCII)


def parse_counts(line: str, bits: int = 32) -> Raw:
    """Read `a_b_c`, three signed counts of so many bits."""
    match = _LINE.fullmatch(line)
    if match is None:
        raise InputError(f"encoder line {line[:40]!r}: expected three signed counts a_b_c")
    a, b, c = (int(text) for text in match.groups())
    half = 1 << (bits - 1)
    if not all(-half <= value < half for value in (a, b, c)):
        raise InputError(f"encoder line {line!r}: expected counts of {bits} bits, {-half} to {half - 1}")
    return a, b, c


class Verdict(Enum):
    """Judgement of a row of counts."""

    GOOD = "good"
    REJECTED = "rejected"  # no joint moves so far in the time: left out
    LOST = "lost"  # counts were lost: rows go on, but from an unknown place


class Tracked(NamedTuple):
    """A row, judged."""

    verdict: Verdict
    counts: Floats  # (3,) in the joints' direction, without ends; the last good ones of a rejected row
    reason: str  # of a verdict that is not good


class CountTracker:
    """Follows three counters over their ends, and refuses what no joint can do.

    A row farther from the last good one than the joints move in the time is left out. When the rows after it go on
    from there instead of coming back, counts were lost: by the cable, by speed, or by the board starting anew. What
    the joints did meanwhile is then unknown.
    """

    def __init__(self, rig: EncoderRig) -> None:
        self._rig = rig
        self._speed = rig.max_speed * rig.counts  # [counts/s]
        self._range = 1 << rig.bits
        self._counts = np.zeros(3)
        self._raw: Raw | None = None  # of the last good row
        self._time = -math.inf
        self._candidate: tuple[Raw, float, int] | None = None  # raw, time, rows that agree

    def restart(self) -> None:
        """Forget where the counters were: the board was unplugged."""
        self._raw, self._candidate = None, None

    def update(self, raw: Raw, time: float, *, period: float = LATENESS) -> Tracked:
        """Judge a row that came at a time [s]; `period` is the time between two [s]."""
        late = max(LATENESS, period)
        if self._raw is None:
            return self._go_on(raw, time, "")
        gap = max(0.0, time - self._time)
        step = self._step(self._raw, raw)
        if gap > SILENCE:
            return self._go_on(raw, time, f"nothing came for {gap:.1f} s: the board may have started anew")
        if max(abs(value) for value in raw) <= NEAR_ZERO and np.abs(np.subtract(raw, self._raw)).max() > FAR:
            return self._go_on(raw, time, "all counts are zero at once: the board started anew")
        if ((gap + late) * self._speed > self._range / 2).any():
            return self._go_on(raw, time, f"nothing came for {gap:.2f} s, too long for {self._rig.bits} bits")
        far = np.abs(step) > (gap + late) * self._speed + SLACK
        if self._candidate is None:
            if not far.any():
                return self._accept(raw, time, step)
            self._candidate = raw, time, 1
            return Tracked(Verdict.REJECTED, self._counts, self._told(far, step))
        return self._doubt(self._candidate, raw, time, step, late)

    def _doubt(self, candidate: tuple[Raw, float, int], raw: Raw, time: float, step: Floats, late: float) -> Tracked:
        """Judge a row after one that was rejected: is it near the last good one, or near the rejected one?"""
        other, since, agree = candidate
        gap = max(0.0, time - since)
        # shares of what joints move in the time of a row, and of two; not of all rejected ones, or any leap would
        # fit after a while
        follow = np.abs(self._step(other, raw)) / ((gap + late) * self._speed + SLACK)
        back = np.abs(step) / ((gap + 2.0 * late) * self._speed + SLACK)
        follows = bool(follow.max() <= 1.0)
        if back.max() <= 1.0 and back.max() <= follow.max():
            return self._accept(raw, time, step)
        self._candidate = raw, time, agree + 1 if follows else 1
        far = np.abs(step) > late * self._speed
        reason = self._told(far if far.any() else np.ones(3, dtype=bool), step)
        if follows and agree + 1 >= CONFIRM:
            return self._go_on(raw, time, reason)
        return Tracked(Verdict.REJECTED, self._counts, reason)

    def _step(self, before: Raw, after: Raw) -> Floats:
        """Return counts from one row to another, the short way round, in the joints' direction."""
        half = self._range // 2
        short = [(b - a + half) % self._range - half for a, b in zip(before, after, strict=True)]
        steps: Floats = self._rig.direction * np.array(short, dtype=float)
        return steps

    def _accept(self, raw: Raw, time: float, step: Floats) -> Tracked:
        self._counts = frozen(self._counts + step)
        self._raw, self._time, self._candidate = raw, time, None
        return Tracked(Verdict.GOOD, self._counts, "")

    def _go_on(self, raw: Raw, time: float, loss: str) -> Tracked:
        """Begin at a row as it is: the first one, or one after a loss."""
        self._counts = frozen(self._rig.direction * np.array(raw, dtype=float))
        self._raw, self._time, self._candidate = raw, time, None
        return Tracked(Verdict.LOST if loss else Verdict.GOOD, self._counts, loss)

    def _told(self, far: NDArray[np.bool_], step: Floats) -> str:
        leaps = [f"{name} by {step[j]:+.0f} counts" for j, name in enumerate(JOINTS) if far[j]]
        return f"leapt beyond what a joint moves in the time: {', '.join(leaps)}"
