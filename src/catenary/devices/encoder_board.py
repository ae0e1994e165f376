"""The board of the encoders at the joints, on a serial line: counts in, joint positions out, once registered."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, frozen
from catenary.devices.encoder_counts import CountTracker, Verdict, parse_counts
from catenary.devices.encoder_rig import EncoderRig, Registration
from catenary.devices.serial_board import BAUD, SerialBoard
from catenary.errors import InputError, SensorError

QUEUE = 4096  # samples that wait to be taken: 40 s at 100 Hz
STALE = 0.2  # [s] without a good row after which positions are no longer valid
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
        self, port: str, rig: EncoderRig | None = None, *, baud: int = BAUD, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Open the port and begin to read, with the calibration rig when None, on a clock [s] that never goes back."""
        self.rig = EncoderRig() if rig is None else rig
        self.tally = EncoderTally()
        self.complaint = ""
        self._tracker, self._registration = CountTracker(self.rig), Registration(self.rig)
        self._samples: deque[EncoderSample] = deque(maxlen=QUEUE)
        self._last: EncoderSample | None = None
        self._period = math.nan  # [s] between rows, as they come
        self._fresh = True  # the next line is the first since the port was opened
        self._lock = threading.Lock()
        super().__init__(port, baud=baud, clock=clock)

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
            elif registered and age > STALE:
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
                rate_hz=0.0 if math.isnan(self._period) or age > STALE else 1.0 / self._period,
                is_connected=connected,
                is_registered=registered,
                is_watching=registration.is_watching,
                complaint=self.complaint,
                tally=asdict(self.tally),
            )

    def _on_gone(self) -> None:
        with self._lock:
            self.tally.unplugged += 1
            self._lose("the board was unplugged")
            self._tracker.restart()

    def _on_back(self) -> None:
        with self._lock:
            self._fresh, self._period = True, math.nan

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
        self._registration.update(moment, counts)
        zero = self._registration.zero
        q = _UNKNOWN if zero is None else frozen(self.rig.positions(counts, zero))
        sample = EncoderSample(moment, counts, q, zero is not None)
        if self._last is not None and 0.0 < moment - self._last.time < 1.0:
            step = moment - self._last.time
            self._period = step if math.isnan(self._period) else self._period + 0.05 * (step - self._period)
        self._last = sample
        self.tally.dropped += len(self._samples) == QUEUE
        self._samples.append(sample)
