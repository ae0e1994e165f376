"""Driver of a serial board with external joint encoders: counter overflow, outliers, registration, joint positions.

The encoders are registered while the robot homes, which moves each joint against its stop, by the rule of the
RAVEN-II's calibration rig [raven2_CRTK_Python_controller]: zero is the mean of the counts within a window of the
farthest ones. The rig allows 60 s from its start; here the robot's state shows when it homes.
"""

import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import ClassVar, NamedTuple

import numpy as np

from catenary.arrays import Floats, as_array, frozen
from catenary.devices.serial_board import SerialBoard
from catenary.errors import InputError, SensorError

_BITS = (16, 24, 32)
_JOINTS = ("shoulder", "elbow", "insertion")


@dataclass(frozen=True)
class EncoderRig:
    """External encoders of the RAVEN-II's positioning joints: shoulder and elbow [rad], insertion [m].

    Constants of the calibration rig [raven2_CRTK_Python_controller]: 80,000 counts a turn, 5 um a count; zero is the
    mean of the counts within a window of the farthest ones at the stops, whose positions are 0, 130 deg and
    0.572467 m. The robot's software assigns 0, 137.5 deg, 0.562 m to the same stops.
    """

    # per rad, rad, m
    counts: ClassVar[Floats] = frozen(np.array([80_000 / (2.0 * np.pi), 80_000 / (2.0 * np.pi), 1.0 / 5e-6]))
    stop: ClassVar[Floats] = frozen(np.array([0.0, np.deg2rad(130.0), 0.572467]))  # [rad, rad, m]
    side: ClassVar[Floats] = frozen(np.array([-1.0, 1.0, 1.0]))  # of the stop: -1 below, 1 above
    window: ClassVar[Floats] = frozen(np.array([50.0, 20.0, 20.0]))  # counts
    # [rad/s, rad/s, m/s] twice the limit of the robot's software (2.5 rad/s); five times the fastest insertion in
    # homing (0.1 m/s)
    max_speed: ClassVar[Floats] = frozen(np.array([5.0, 5.0, 0.5]))
    direction: Floats = field(default_factory=lambda: np.ones(3))  # (3,) 1 or -1: sign of counts per joint motion
    bits: int = 32  # of the board's counters, which wrap around: 16, 24 or 32

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", frozen(as_array("encoder rig direction", self.direction, (3,))))
        if not (np.abs(self.direction) == 1.0).all():
            raise InputError(f"encoder rig direction: expected 1 or -1 each, got {self.direction}")
        if self.bits not in _BITS:
            raise InputError(f"encoder rig bits: expected one of {_BITS}, got {self.bits}")

    def positions(self, counts: Floats, zero: Floats) -> Floats:
        """Return joint positions (..., 3) [rad, rad, m] of counts (..., 3); `zero` (3,) are the counts at the stops."""
        return self.stop + (counts - zero) / self.counts


# [rad, rad, m] least travel towards a stop; travel beyond it by as much shows that it was no stop
_LEAST_TRAVEL = (np.deg2rad(1.0), np.deg2rad(1.0), 0.002)


class Registration:
    """Determine the counts at the stops while the robot homes, by its reported state.

    A joint that later passes its stop invalidates the registration.
    """

    def __init__(self, rig: EncoderRig) -> None:
        self._rig = rig
        self.zero: Floats | None = None  # (3,) counts at the stops
        self.reason = "not registered: home the robot"  # empty once registered
        self.is_watching = False  # the robot is homing
        self._travel = np.array(_LEAST_TRAVEL) * rig.counts
        self._seen: list[Floats] = []

    def lose(self, reason: str) -> None:
        """Invalidate the registration: counts were lost."""
        self.zero, self.reason = None, f"{reason}; not registered: home the robot again"
        self._seen.clear()

    def set_robot_state(self, homing: bool, homed: bool) -> None:
        """Update by the robot's operating state: register at the end of homing."""
        was, self.is_watching = self.is_watching, homing
        if homing and not was:
            self.zero, self.reason = None, "not registered: the robot is homing"
            self._seen.clear()
        elif was and not homing:
            self._register(homed)
            self._seen.clear()

    def update(self, counts: Floats) -> None:
        """Add a valid row of counts (3,)."""
        if self.zero is not None:
            past = (counts - self.zero) * self._rig.side > self._travel
            if past.any():
                which = ", ".join(name for name, is_past in zip(_JOINTS, past, strict=True) if is_past)
                self.lose(f"{which} moved beyond the registered stop")
        elif self.is_watching:
            self._seen.append(counts)

    def _register(self, homed: bool) -> None:
        """Set zero to the mean of the counts within a window of the farthest."""
        toward = np.array(self._seen).reshape(-1, 3) * self._rig.side
        travelled = len(toward) and (toward.max(axis=0) - toward[0] > self._travel).any()
        if not (homed and travelled):
            without = "the joints having moved" if homed else "the robot being homed"
            self.reason = f"not registered: homing ended without {without}"
            return
        in_window = toward.max(axis=0) - toward <= self._rig.window
        self.zero = frozen(self._rig.side * np.where(in_window, toward, 0.0).sum(axis=0) / in_window.sum(axis=0))
        self.reason = ""


_LATENESS_S = 0.02  # [s] delay of a line; Linux's serial drivers buffer USB data for 16 ms
_FLICKER_COUNTS = 2  # jitter of an encoder at rest
_CONFIRMING_ROWS = 5  # consistent rows after a jump before it is accepted
_SILENCE_S = 1.0  # [s] after which the board may have been restarted: an Arduino takes that long
_NEAR_ZERO_COUNTS, _RESTART_COUNTS = 20, 2000  # a jump of all counters to zero is a restart of the board
Raw = tuple[int, int, int]
_LINE = re.compile(r"(-?\d{1,10})_(-?\d{1,10})_(-?\d{1,10})", re.ASCII)


def parse_counts(line: str, bits: int = 32) -> Raw:
    """Parse a line `a_b_c`, three signed counts of a number of bits."""
    match = _LINE.fullmatch(line)
    if match is None:
        raise InputError(f"encoder line {line[:40]!r}: expected three signed counts a_b_c")
    a, b, c = (int(text) for text in match.groups())
    half = 1 << (bits - 1)
    if not all(-half <= value < half for value in (a, b, c)):
        raise InputError(f"encoder line {line!r}: expected counts of {bits} bits, {-half} to {half - 1}")
    return a, b, c


class Verdict(Enum):
    """Validity of a row of counts."""

    GOOD = "good"
    REJECTED = "rejected"  # faster than a joint can move: discarded
    LOST = "lost"  # counts were lost: rows continue from an unknown position


class Tracked(NamedTuple):
    """A row of counts with its verdict."""

    verdict: Verdict
    counts: Floats  # (3,) unwrapped, in the joints' direction; the last good ones if rejected
    reason: str  # empty for a good row


class CountTracker:
    """Unwrap three counters, and reject rows that no joint motion explains.

    A row farther from the last good one than the joints can move is rejected. If later rows agree with it, counts were
    lost: by the cable, by speed, or by a restart of the board; the motion meanwhile is unknown.
    """

    def __init__(self, rig: EncoderRig) -> None:
        self._rig = rig
        self._speed = rig.max_speed * rig.counts  # [counts/s]
        self._range = 1 << rig.bits
        self._counts = np.zeros(3)
        self._raw: Raw | None = None  # of the last good row
        self._time = -math.inf
        self._candidate: tuple[Raw, float, int] | None = None  # rejected row, its time, rows that agree with it

    def restart(self) -> None:
        """Discard the counters' state: the board was unplugged."""
        self._raw, self._candidate = None, None

    def update(self, raw: Raw, time: float, *, period: float = _LATENESS_S) -> Tracked:
        """Check a row that arrived at a time [s]; `period` is the interval of rows [s]."""
        late = max(_LATENESS_S, period)
        if self._raw is None:
            return self._go_on(raw, time)
        gap, step = max(0.0, time - self._time), self._step(self._raw, raw)
        if gap > _SILENCE_S:
            return self._go_on(raw, time, f"no counts for {gap:.1f} s: the board may have restarted")
        leap = np.abs(np.subtract(raw, self._raw)).max()
        if max(map(abs, raw)) <= _NEAR_ZERO_COUNTS and leap > _RESTART_COUNTS:
            return self._go_on(raw, time, "all counts jumped to zero: the board restarted")
        if ((gap + late) * self._speed > self._range / 2).any():
            return self._go_on(raw, time, f"no counts for {gap:.2f} s, too long for {self._rig.bits} bits")
        # motion relative to the largest possible since the last good row and since the rejected one; the time since a
        # rejected row limits both, otherwise any jump would be possible after a while
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
        leaps = [f"{name} by {step[j]:+.0f} counts" for j, name in enumerate(_JOINTS) if far[j] or not far.any()]
        reason = f"jumped farther than a joint can move: {', '.join(leaps)}"
        if agree >= _CONFIRMING_ROWS:
            return self._go_on(raw, time, reason)
        self._candidate = raw, time, agree
        return Tracked(Verdict.REJECTED, self._counts, reason)

    def _step(self, before: Raw, after: Raw) -> Floats:
        """Return the shortest step between two rows, modulo the counters' range, in the joints' direction."""
        half = self._range // 2
        short = [(b - a + half) % self._range - half for a, b in zip(before, after, strict=True)]
        return self._rig.direction * np.array(short, dtype=float)

    def _go_on(self, raw: Raw, time: float, loss: str = "", step: Floats | None = None) -> Tracked:
        """Accept a row by its step from the last one, or its raw counts at the start and after a loss."""
        counts = self._rig.direction * np.array(raw, dtype=float) if step is None else self._counts + step
        self._counts, self._raw, self._time, self._candidate = frozen(counts), raw, time, None
        return Tracked(Verdict.LOST if loss else Verdict.GOOD, self._counts, loss)


_QUEUE_ROWS = 4096  # capacity for samples: 40 s at 100 Hz
_STALE_AFTER_S = 0.2  # [s] without a good row after which positions are invalid
_UNKNOWN = frozen(np.full(3, np.nan))


@dataclass
class EncoderTally:
    """Statistics of a line since it was opened."""

    rows: int = 0  # good ones
    malformed: int = 0  # noise and truncated lines
    cut: int = 0  # first lines after opening the port, possibly truncated, discarded
    rejected: int = 0  # rows faster than a joint can move
    losses: int = 0  # of counts
    unplugged: int = 0
    dropped: int = 0  # samples lost by overflow of the queue


class EncoderSample(NamedTuple):
    """One good row."""

    time: float  # [s] on the driver's clock
    counts: Floats  # (3,) unwrapped, in the joints' direction
    q_encoder: Floats  # (3,) [rad, rad, m]; NaN while not registered
    is_valid: bool


class EncoderReading(NamedTuple):
    """State of the board, and its newest positions."""

    counts: Floats  # (3,) the last good ones; NaN before the first
    q_encoder: Floats  # (3,) [rad, rad, m]; NaN while invalid
    is_valid: bool  # registered, connected and fresh
    age: float  # [s] of the last good row; inf before the first
    reason: str  # of invalid positions; empty if valid
    rate_hz: float  # of good rows
    is_connected: bool
    is_registered: bool
    is_watching: bool  # registration is in progress
    complaint: str  # error of the last discarded line or row
    tally: dict[str, int]


class EncoderBoard(SerialBoard):
    """Read a board of encoders, and register it while the robot homes.

    Positions are valid once registered at the joints' stops. Unplugging loses the counts and the registration: the
    robot must be homed again.
    """

    def __init__(
        self, port: str, rig: EncoderRig | None = None, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Open the port and start reading, the calibration rig when None; `clock` stamps the samples [s]."""
        self.rig = EncoderRig() if rig is None else rig
        self.tally = EncoderTally()
        self.complaint = ""
        self._tracker, self._registration = CountTracker(self.rig), Registration(self.rig)
        self._samples: deque[EncoderSample] = deque(maxlen=_QUEUE_ROWS)
        self._last: EncoderSample | None = None
        self._period = math.nan  # [s] mean interval of rows
        self._fresh = True  # the next line is the first after opening the port
        self._lock = threading.Lock()
        super().__init__(port, clock=clock)

    def now(self) -> float:
        """Return the time [s] on the samples' clock."""
        return self._clock()

    def set_robot_state(self, *, is_busy: bool, is_homed: bool) -> None:
        """Update by the robot's operating state: it homes while it is busy and not homed."""
        with self._lock:
            self._registration.set_robot_state(is_busy and not is_homed, is_homed)

    def take(self) -> list[EncoderSample]:
        """Remove and return the good rows since the last call, oldest first."""
        with self._lock:
            taken = list(self._samples)
            self._samples.clear()
        return taken

    def wait_ready(self, timeout: float = 5.0) -> None:
        """Wait for the first good row; a microcontroller restarts when its port is opened, which takes 2 s."""
        end = time.monotonic() + timeout
        while self._last is None:
            if time.monotonic() > end:
                raise SensorError(
                    f"{self.port}: no row of counts within {timeout:g} s: {self.tally.malformed} other lines"
                    + (f" ({self.complaint})" if self.complaint else "")
                    + "; expected lines a_b_c, see docs/devices.md"
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
                # lines received together were sent a period apart
                period = 0.0 if math.isnan(self._period) else self._period
                self._check(raw, arrival - period * (len(lines) - 1 - k))

    def _check(self, raw: tuple[int, int, int], moment: float) -> None:
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
