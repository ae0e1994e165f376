"""The board of the encoders at the joints, on a serial line: counts in, joint positions out, once registered.

Its lines are read, its counters' ends crossed, and rows that cannot be true left out.
"""

import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, frozen
from catenary.devices.encoder_rig import JOINTS, EncoderRig, Registration
from catenary.devices.serial_board import SerialBoard
from catenary.errors import InputError, SensorError

# [s] by which a line may be late; Linux's serial drivers gather what USB brings for 16 ms
_LATENESS_S = 0.02
_FLICKER_COUNTS = 2  # counts by which an encoder flickers
_CONFIRMING_ROWS = 5  # rows in a row that go on from one that leapt, before it is taken for the truth
_SILENCE_S = 1.0  # [s] after which the board may have been restarted: an Arduino takes that long
_NEAR_ZERO_COUNTS, _RESTART_COUNTS = 20, 2000  # counts: all at zero at once, from afar, is a board that began anew
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

    def update(self, raw: Raw, time: float, *, period: float = _LATENESS_S) -> Tracked:
        """Judge a row that came at a time [s]; `period` is the time between two [s]."""
        late = max(_LATENESS_S, period)
        if self._raw is None:
            return self._go_on(raw, time)
        gap, step = max(0.0, time - self._time), self._step(self._raw, raw)
        if gap > _SILENCE_S:
            return self._go_on(raw, time, f"nothing came for {gap:.1f} s: the board may have started anew")
        leap = np.abs(np.subtract(raw, self._raw)).max()
        if max(map(abs, raw)) <= _NEAR_ZERO_COUNTS and leap > _RESTART_COUNTS:
            return self._go_on(raw, time, "all counts are zero at once: the board started anew")
        if ((gap + late) * self._speed > self._range / 2).any():
            return self._go_on(raw, time, f"nothing came for {gap:.2f} s, too long for {self._rig.bits} bits")
        # shares of what joints move since the last good row, and since the rejected one: where there is one not of
        # all that passed since the good one, or any leap would fit after a while
        follow, agree = np.full(3, np.inf), 0
        if self._candidate is not None:
            other, since, agree = self._candidate
            gap = max(0.0, time - since)
            follow = np.abs(self._step(other, raw)) / ((gap + late) * self._speed + _FLICKER_COUNTS)
            gap += late
        back = np.abs(step) / ((gap + late) * self._speed + _FLICKER_COUNTS)
        if back.max() <= min(1.0, follow.max()):
            return self._go_on(raw, time, step=step)
        agree = agree + 1 if follow.max() <= 1.0 else 1
        far = np.abs(step) > late * self._speed
        leaps = [f"{name} by {step[j]:+.0f} counts" for j, name in enumerate(JOINTS) if far[j] or not far.any()]
        reason = f"leapt beyond what a joint moves in the time: {', '.join(leaps)}"
        if agree >= _CONFIRMING_ROWS:
            return self._go_on(raw, time, reason)
        self._candidate = raw, time, agree
        return Tracked(Verdict.REJECTED, self._counts, reason)

    def _step(self, before: Raw, after: Raw) -> Floats:
        """Return counts from one row to another, the short way round, in the joints' direction."""
        half = self._range // 2
        short = [(b - a + half) % self._range - half for a, b in zip(before, after, strict=True)]
        return self._rig.direction * np.array(short, dtype=float)

    def _go_on(self, raw: Raw, time: float, loss: str = "", step: Floats | None = None) -> Tracked:
        """Take a row by its step from the one before, or as it is: the first one, or one after a loss."""
        counts = self._rig.direction * np.array(raw, dtype=float) if step is None else self._counts + step
        self._counts, self._raw, self._time, self._candidate = frozen(counts), raw, time, None
        return Tracked(Verdict.LOST if loss else Verdict.GOOD, self._counts, loss)


_QUEUE_ROWS = 4096  # samples that wait to be taken: 40 s at 100 Hz
_STALE_AFTER_S = 0.2  # [s] without a good row after which positions are no longer valid
_UNKNOWN = frozen(np.full(3, np.nan))


@dataclass
class EncoderTally:
    """Counts of what came over the line since it was opened."""

    rows: int = 0  # good ones
    malformed: int = 0  # lines that are none: noise, cut ones
    cut: int = 0  # first lines after the port was opened, which begin anywhere, left out
    rejected: int = 0  # rows that no joint could reach in the time
    losses: int = 0  # times that counts were lost
    unplugged: int = 0
    dropped: int = 0  # samples that nobody took


class EncoderSample(NamedTuple):
    """One good row."""

    time: float  # [s] on the driver's clock
    counts: Floats  # (3,) in the joints' direction, without the counters' ends
    q_encoder: Floats  # (3,) [rad, rad, m]; NaN while not registered
    is_valid: bool


class EncoderReading(NamedTuple):
    """State of the board, and its newest positions."""

    counts: Floats  # (3,) the last good ones; NaN before any
    q_encoder: Floats  # (3,) [rad, rad, m]; NaN while they are not valid
    is_valid: bool  # registered, connected and fresh
    age: float  # [s] of the last good row; inf before any
    reason: str  # why positions are not valid
    rate_hz: float  # of good rows
    is_connected: bool
    is_registered: bool
    is_watching: bool  # for the stops
    complaint: str  # why the last line or row was left out
    tally: dict[str, int]


class EncoderBoard(SerialBoard):
    """Reads a board and registers it while the robot homes.

    Positions are valid once registered against the joints' stops. Unplugging loses the counts, and with them the
    registration: the robot must be homed again.
    """

    def __init__(
        self, port: str, rig: EncoderRig | None = None, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Open the port and begin to read, with the calibration rig when None, on a clock [s] that never goes back."""
        self.rig = EncoderRig() if rig is None else rig
        self.tally = EncoderTally()
        self.complaint = ""
        self._tracker, self._registration = CountTracker(self.rig), Registration(self.rig)
        self._samples: deque[EncoderSample] = deque(maxlen=_QUEUE_ROWS)
        self._last: EncoderSample | None = None
        self._period = math.nan  # [s] between rows, as they come
        self._fresh = True  # the next line is the first since the port was opened
        self._lock = threading.Lock()
        super().__init__(port, clock=clock)

    def now(self) -> float:
        """Return the time [s] on the clock that samples are stamped with."""
        return self._clock()

    def tell(self, *, is_busy: bool, is_homed: bool) -> None:
        """Take the robot's operating state: it homes while it is busy and not homed."""
        with self._lock:
            self._registration.tell(is_busy and not is_homed, is_homed)

    def take(self) -> list[EncoderSample]:
        """Take out and return the good rows since the last call, oldest first."""
        with self._lock:
            taken = list(self._samples)
            self._samples.clear()
        return taken

    def wait_ready(self, timeout: float = 5.0) -> None:
        """Wait for the first good row; a microcontroller restarts when its port is opened, and takes 2 s."""
        end = time.monotonic() + timeout
        while self._last is None:
            if time.monotonic() > end:
                raise SensorError(
                    f"{self.port}: no row of counts within {timeout:g} s: {self.tally.malformed} other lines"
                    + (f" ({self.complaint})" if self.complaint else "")
                    + "; expected lines a_b_c, as docs/devices.md has them"
                )
            time.sleep(0.005)

    def reading(self) -> EncoderReading:
        """Return the state of the board, and its newest positions."""
        with self._lock:
            last, registration = self._last, self._registration
            age = math.inf if last is None else max(0.0, self._clock() - last.time)
            zero = registration.zero
            connected, registered = self.is_connected, zero is not None
            reason = registration.reason
            if not connected:
                reason = "unplugged: the counts are lost; plug in, then home the robot"
            elif registered and age > _STALE_AFTER_S:
                reason = f"no counts for {age:.1f} s"
            valid = registered and not reason
            q = _UNKNOWN
            if valid and zero is not None and last is not None:
                q = frozen(self.rig.positions(last.counts, zero))
            return EncoderReading(
                counts=_UNKNOWN if last is None else last.counts,
                q_encoder=q,
                is_valid=valid,
                age=age,
                reason=reason,
                rate_hz=0.0 if math.isnan(self._period) or age > _STALE_AFTER_S else 1.0 / self._period,
                is_connected=connected,
                is_registered=registered,
                is_watching=registration.is_watching,
                complaint=self.complaint,
                tally=asdict(self.tally),
            )

    def _on_plug(self, *, is_there: bool) -> None:
        with self._lock:
            if is_there:
                self._fresh, self._period = True, math.nan
                return
            self.tally.unplugged += 1
            self._lose("the board was unplugged")
            self._tracker.restart()

    def _lose(self, reason: str) -> None:
        self.tally.losses += 1
        self.complaint = reason
        self._registration.lose(reason)

    def _take(self, lines: list[str], arrival: float) -> None:
        with self._lock:
            for k, line in enumerate(lines):
                if self._fresh:
                    self._fresh = False
                    self.tally.cut += 1
                    continue
                try:
                    raw = parse_counts(line, self.rig.bits)
                except InputError as error:
                    self.tally.malformed += 1
                    self.complaint = str(error)
                    continue
                # lines that come in one piece were sent a period apart
                period = 0.0 if math.isnan(self._period) else self._period
                self._judge(raw, arrival - period * (len(lines) - 1 - k))

    def _judge(self, raw: tuple[int, int, int], moment: float) -> None:
        if self._last is not None:
            moment = max(moment, self._last.time)
        late = 0.0 if math.isnan(self._period) else self._period
        verdict, counts, reason = self._tracker.update(raw, moment, period=late)
        if verdict is Verdict.REJECTED:
            self.tally.rejected += 1
            self.complaint = reason
            return
        if verdict is Verdict.LOST:
            self._lose(reason)
        self.tally.rows += 1
        self._registration.update(counts)
        zero = self._registration.zero
        q = _UNKNOWN if zero is None else frozen(self.rig.positions(counts, zero))
        sample = EncoderSample(moment, counts, q, zero is not None)
        if self._last is not None and 0.0 < moment - self._last.time < 1.0:
            step = moment - self._last.time
            self._period = step if math.isnan(self._period) else self._period + 0.05 * (step - self._period)
        self._last = sample
        self.tally.dropped += len(self._samples) == _QUEUE_ROWS
        self._samples.append(sample)
