"""An accelerometer board on a serial line, read by a thread of its own into a mailbox."""

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import TracebackType

import numpy as np
import serial
import serial.tools.list_ports

from catenary.devices.board_clock import BoardClock
from catenary.devices.line_protocol import (
    ACCELERATION_UNITS,
    RATE_UNITS,
    BoardSample,
    ChecksumError,
    Hello,
    LineSplitter,
    parse_line,
)
from catenary.errors import InputError, SensorError
from catenary.gravity.mounting import Mounting
from catenary.gravity.samples import Kind, Mailbox

BAUD = 115200
RETRY = 0.25  # [s] between attempts to find a board that was unplugged
ASK = b"?\n"  # the board answers with a hello
_log = logging.getLogger(__name__)


@dataclass
class LinkCounts:
    """What came over the line since it was opened."""

    samples: int = 0
    damaged: int = 0  # lines that failed the checksum, or were noise
    malformed: int = 0  # right checksum, wrong content
    missing: int = 0  # samples that the board counted and that never came
    repeated: int = 0  # samples that came again, left out
    before_hello: int = 0  # samples whose unit was not known yet, left out
    unplugged: int = 0
    restarts: int = 0  # of the board


class SerialAccelerometer:
    """Reads a board and puts its samples into a mailbox, in m/s2 and rad/s, stamped on the host's clock.

    A board that is unplugged is waited for, and goes on where it is plugged in again under the same name. Stamps
    are on `clock`, which must be the one that the robot's JointState.time is on. Use as a context manager.
    """

    def __init__(
        self,
        port: str,
        mailbox: Mailbox,
        *,
        baud: int = BAUD,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Open the port and begin to read.

        Raises:
            SensorError: The port cannot be opened; the message lists those that there are.
        """
        self.port, self.mailbox, self.counts = port, mailbox, LinkCounts()
        self.hello: Hello | None = None
        self.complaint = ""  # the last line that was malformed, in words
        self._baud, self._clock = baud, clock
        self._board_clock = BoardClock()
        self._last_number: int | None = None
        self._ending = threading.Event()
        self._greeted = threading.Event()
        try:
            self._line: serial.Serial | None = self._open()
        except (serial.SerialException, OSError, ValueError) as error:
            ports = ", ".join(sorted(p.device for p in serial.tools.list_ports.comports())) or "none"
            raise SensorError(f"{port}: cannot be opened: {error}; serial ports here: {ports}") from error
        self._thread = threading.Thread(target=self._run, name=f"catenary {port}", daemon=True)
        self._thread.start()

    def __enter__(self) -> "SerialAccelerometer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def is_connected(self) -> bool:
        """The port is open; samples may come."""
        return self._line is not None

    def wait_ready(self, timeout: float = 5.0) -> Hello:
        """Wait until the board has said what it is; an Arduino restarts when its port is opened, and takes 2 s.

        Raises:
            SensorError: It has not; the message says what came instead.
        """
        if not self._greeted.wait(timeout) or self.hello is None:
            c = self.counts
            raise SensorError(
                f"{self.port}: no hello within {timeout:g} s: {c.before_hello} samples, {c.damaged} damaged lines"
                + (f", {c.malformed} malformed ({self.complaint})" if c.malformed else "")
                + "; expected the protocol of docs/devices.md at "
                + f"{self._baud} baud"
            )
        return self.hello

    def with_ranges(self, mounting: Mounting) -> Mounting:
        """The mounting with the board's ranges where it states none.

        Raises:
            SensorError: The board has not said hello.
        """
        hello = self.wait_ready(0.0)
        if math.isinf(mounting.acceleration_range):
            end = hello.acceleration_range * ACCELERATION_UNITS[hello.acceleration_unit]
            mounting = replace(mounting, acceleration_range=end)
        if math.isinf(mounting.rate_range) and hello.has_gyroscope and hello.rate_range > 0.0:
            mounting = replace(mounting, rate_range=hello.rate_range * RATE_UNITS[hello.rate_unit])
        return mounting if mounting.sensor else replace(mounting, sensor=hello.sensor)

    def close(self) -> None:
        """Stop reading and close the port."""
        self._ending.set()
        self._thread.join(timeout=2.0)
        self._drop()

    def _open(self) -> serial.Serial:
        line = serial.Serial(self.port, self._baud, timeout=0.05, write_timeout=0.2)
        line.write(ASK)
        return line

    def _drop(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            try:
                line.close()
            except OSError as error:
                _log.debug("%s: closing: %s", self.port, error)

    def _run(self) -> None:
        splitter = LineSplitter()
        while not self._ending.is_set():
            if self._line is None:
                self._ending.wait(RETRY)
                try:
                    self._line = self._open()
                except (serial.SerialException, OSError, ValueError):
                    continue  # not there yet
                splitter, self._last_number = LineSplitter(), None
                self._board_clock = BoardClock()
                continue
            try:
                data = self._line.read(max(1, self._line.in_waiting))
            except (
                serial.SerialException,
                OSError,
                TypeError,
            ):  # unplugged; pyserial may trip over its own close
                self.counts.unplugged += 1
                _log.warning("%s: the board is gone; waiting for it", self.port)
                self._drop()
                continue
            if data:
                arrival = self._clock()
                for text in splitter.feed(data):
                    self._take(text, arrival)

    def _take(self, text: str, arrival: float) -> None:
        try:
            line = parse_line(text)
        except ChecksumError:
            self.counts.damaged += 1
            return
        except InputError as error:
            self.counts.malformed += 1
            self.complaint = str(error)
            return
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
