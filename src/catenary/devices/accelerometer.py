"""An accelerometer board on a serial line, read by a thread of its own into a mailbox."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from catenary.devices.board_clock import BoardClock
from catenary.devices.line_protocol import (
    ACCELERATION_UNITS,
    RATE_UNITS,
    BoardSample,
    ChecksumError,
    Hello,
    parse_line,
)
from catenary.devices.serial_board import BAUD, SerialBoard
from catenary.errors import InputError, SensorError
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Kind, Mailbox

ASK = b"?\n"  # the board answers with a hello


@dataclass
class LinkCounts:
    """Counts of what came over the line since it was opened."""

    samples: int = 0
    damaged: int = 0  # lines that failed the checksum, or were noise
    malformed: int = 0  # right checksum, wrong content
    missing: int = 0  # samples that the board counted and that never came
    repeated: int = 0  # samples that came again, left out
    before_hello: int = 0  # samples whose unit was not known yet, left out
    unplugged: int = 0
    restarts: int = 0  # of the board


class SerialAccelerometer(SerialBoard):
    """Reads a board and puts its samples into a mailbox, in m/s2 and rad/s, stamped on the host's clock.

    Stamps are on `clock`, which must be the one that the robot's JointState.time is on.
    """

    def __init__(
        self, port: str, mailbox: Mailbox, *, baud: int = BAUD, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Open the port and begin to read."""
        self.mailbox, self.counts = mailbox, LinkCounts()
        self.hello: Hello | None = None
        self.complaint = ""  # why the last malformed line was refused
        self._board_clock = BoardClock()
        self._last_number: int | None = None
        self._greeted = threading.Event()
        super().__init__(port, baud=baud, clock=clock, ask=ASK)

    def wait_ready(self, timeout: float = 5.0) -> Hello:
        """Wait for the board's hello and return it; an Arduino restarts when its port is opened, and takes 2 s."""
        if not self._greeted.wait(timeout) or self.hello is None:
            c = self.counts
            raise SensorError(
                f"{self.port}: no hello within {timeout:g} s: {c.before_hello} samples, {c.damaged} damaged lines"
                + (f", {c.malformed} malformed ({self.complaint})" if c.malformed else "")
                + "; expected the protocol of docs/devices.md at "
                + f"{self.baud} baud"
            )
        return self.hello

    def with_ranges(self, mounting: Mounting) -> Mounting:
        """Return the mounting with the board's ranges where it states none."""
        hello = self.wait_ready(0.0)
        if math.isinf(mounting.acceleration_range):
            end = hello.acceleration_range * ACCELERATION_UNITS[hello.acceleration_unit]
            mounting = replace(mounting, acceleration_range=end)
        if math.isinf(mounting.rate_range) and hello.has_gyroscope and hello.rate_range > 0.0:
            mounting = replace(mounting, rate_range=hello.rate_range * RATE_UNITS[hello.rate_unit])
        return mounting if mounting.sensor else replace(mounting, sensor=hello.sensor)

    def _on_gone(self) -> None:
        self.counts.unplugged += 1

    def _on_back(self) -> None:
        self._last_number = None
        self._board_clock = BoardClock()

    def _take(self, lines: list[str], arrival: float) -> None:
        for text in lines:
            try:
                line = parse_line(text)
            except ChecksumError:
                self.counts.damaged += 1
            except InputError as error:
                self.counts.malformed += 1
                self.complaint = str(error)
            else:
                if isinstance(line, Hello):
                    self.hello = line
                    self._greeted.set()
                else:
                    self._deliver(line, arrival)

    def _deliver(self, sample: BoardSample, arrival: float) -> None:
        counts = self.counts
        if self._last_number is not None:
            step = (sample.number - self._last_number) % 2**16
            if step == 0:
                counts.repeated += 1
                return
            if step < 2**15:  # else the board began anew
                counts.missing += step - 1
        self._last_number = sample.number
        stamp = self._board_clock.stamp(sample.micros, arrival)
        counts.restarts = max(counts.restarts, self._board_clock.restarts)
        if self.hello is None:
            counts.before_hello += 1
            return
        counts.samples += 1
        force = np.array(sample.acceleration) * ACCELERATION_UNITS[self.hello.acceleration_unit]
        # rates first: when gravity is looked at, how the base turned meanwhile is known
        if sample.rate is not None and self.hello.has_gyroscope:
            self.mailbox.put(
                stamp, np.array(sample.rate) * RATE_UNITS[self.hello.rate_unit], Kind.ANGULAR_RATE
            )
        self.mailbox.put(stamp, force, Kind.SPECIFIC_FORCE)
