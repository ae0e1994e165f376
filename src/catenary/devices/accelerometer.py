"""Driver of a serial accelerometer or IMU board: line protocol, clock synchronisation, samples to a mailbox.

The line protocol, one checksummed ASCII line a sample, is described in docs/devices.md.
"""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from operator import xor
from typing import Any, NamedTuple

import numpy as np

from catenary.devices.serial_board import BAUD, SerialBoard
from catenary.errors import InputError, SensorError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.mounting import Mounting
from catenary.units import ACCELERATION_UNITS, RATE_UNITS

_VERSION = 1


class Hello(NamedTuple):
    """Self-description of a board, sent on request and once a second."""

    sensor: str
    acceleration_unit: str  # a key of ACCELERATION_UNITS
    acceleration_range: float  # in that unit
    rate_unit: str  # a key of RATE_UNITS; "none" without gyroscope
    rate_range: float  # in that unit
    rate_hz: float

    @property
    def has_gyroscope(self) -> bool:
        """Samples carry angular rates."""
        return self.rate_unit != "none"


class BoardSample(NamedTuple):
    """One line of measurements, in the units of the hello."""

    number: int  # sample counter, modulo 2^16
    micros: int  # [us] of the board's clock, modulo 2^32
    acceleration: tuple[float, float, float]  # specific force: upwards at rest
    rate: tuple[float, float, float] | None


def checksum(body: str) -> str:
    """Return the XOR of all characters between $ and * as two hexadecimal digits, as in NMEA 0183."""
    return f"{reduce(xor, map(ord, body), 0):02X}"


def parse_line(line: str) -> Hello | BoardSample:
    """Parse a line without its end.

    Raises:
        ChecksumError: The line is damaged.
        InputError: The checksum is right, the content is not.
    """
    if not line.startswith("$") or line[-3:-2] != "*":
        raise ChecksumError(f"not a line of the protocol: {line[:40]!r}")
    body = line[1:-3]
    if checksum(body) != line[-2:].upper():
        raise ChecksumError(f"checksum {line[-2:]}, expected {checksum(body)}")
    kind, *fields = body.split(",")
    try:
        if kind == "CATHI":
            return _hello(fields)
        if kind == "CATAC" and len(fields) in (5, 8):
            values = [float(text) for text in fields[2:]]
            x, y, z, *rates = values
            number, micros = int(fields[0]), int(fields[1])
            rate = (rates[0], rates[1], rates[2]) if rates else None
            return BoardSample(number % 2**16, micros % 2**32, (x, y, z), rate)
    except ValueError as error:
        raise InputError(f"{kind}: {error}") from error
    raise InputError(f"{kind} with {len(fields)} fields: expected CATHI with 7, or CATAC with 5 or 8")


class ChecksumError(InputError):
    """A line was damaged: noise, a lost byte, or another baud rate."""


def _hello(fields: list[str]) -> Hello:
    if len(fields) != 7 or int(fields[0]) != _VERSION:
        raise InputError(f"hello: expected version {_VERSION} and 7 fields, got {fields[:1]}, {len(fields)} fields")
    _, sensor, unit, end, rate_unit, rate_end, rate_hz = fields
    for name, value, choices in (("unit", unit, ACCELERATION_UNITS), ("rate unit", rate_unit, RATE_UNITS)):
        if value not in choices:
            raise InputError(f'hello: {name} "{value}": expected one of {", ".join(choices)}')
    hello = Hello(sensor, unit, float(end), rate_unit, float(rate_end), float(rate_hz))
    if not (hello.acceleration_range > 0.0 and hello.rate_hz > 0.0 and hello.rate_range >= 0.0):
        raise InputError(f"hello: expected positive ranges and rate, got {fields}")
    return hello


_WRAP_US = 2**32  # [us] period of a board's clock: 71.6 minutes
_CLOCK_DRIFT = 0.01  # largest relative drift; ceramic resonators are accurate to 0.005
_RESTART_LEAP_S = 10.0  # [s] least jump that shows a restart of the board


class BoardClock:
    """Convert a board's microseconds to the host's seconds.

    The offset of the clocks is the smallest difference between arrival and board time, since the delay of some samples
    is near the minimum. It may grow by one percent, to follow a slow board. The remaining error is the smallest delay
    of the line, constant and one or two milliseconds over USB.
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._elapsed = 0.0  # [s] on the board's clock since its first line
        self._offset = 0.0
        self.restarts = 0

    def stamp(self, micros: int, arrival: float) -> float:
        """Return a sample's time [s] on the host's clock from the board's [us], modulo 2^32, and the arrival [s]."""
        step = 0.0 if self._last is None else (micros - self._last) % _WRAP_US * 1e-6
        if self._last is None or step > _RESTART_LEAP_S:  # back, or far ahead
            self.restarts += self._last is not None
            self._elapsed, self._offset = 0.0, arrival
        else:
            self._elapsed += step
            self._offset = min(self._offset + _CLOCK_DRIFT * step, arrival - self._elapsed)
        self._last = micros
        return self._offset + self._elapsed


_ASK = b"?\n"  # requests a hello


@dataclass
class LinkCounts:
    """Statistics of a line since it was opened."""

    samples: int = 0
    damaged: int = 0  # lines with a wrong checksum, and noise
    malformed: int = 0  # right checksum, wrong content
    missing: int = 0  # gaps in the sample counter
    repeated: int = 0  # repeated samples, discarded
    before_hello: int = 0  # samples of unknown unit, discarded
    unplugged: int = 0
    restarts: int = 0  # of the board


class SerialAccelerometer(SerialBoard):
    """Read a board in a thread and deliver its samples to a mailbox, in m/s2 and rad/s.

    Args:
        port: Serial port, such as /dev/ttyUSB0.
        clock: Clock of the stamps [s], the same as that of JointState.time.
    """

    def __init__(self, port: str, mailbox: Mailbox, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.mailbox, self.counts = mailbox, LinkCounts()
        self.hello: Hello | None = None
        self.complaint = ""  # error of the last malformed line
        self._board_clock = BoardClock()
        self._last_number: int | None = None
        self._greeted = threading.Event()
        super().__init__(port, clock=clock, ask=_ASK)

    def wait_ready(self, timeout: float = 5.0) -> Hello:
        """Wait for the board's hello and return it; an Arduino restarts when its port is opened, which takes 2 s."""
        if not self._greeted.wait(timeout) or self.hello is None:
            c = self.counts
            raise SensorError(
                f"{self.port}: no hello within {timeout:g} s: {c.before_hello} samples, {c.damaged} damaged lines"
                + (f", {c.malformed} malformed ({self.complaint})" if c.malformed else "")
                + f"; expected the protocol of docs/devices.md at {BAUD} baud"
            )
        return self.hello

    def with_ranges(self, mounting: Mounting) -> Mounting:
        """Return the mounting with the board's ranges in place of infinite ones."""
        hello = self.wait_ready(0.0)
        ends = {
            "acceleration_range": hello.acceleration_range * ACCELERATION_UNITS[hello.acceleration_unit],
            "rate_range": hello.rate_range * RATE_UNITS[hello.rate_unit],  # 0 for none
        }
        missing: dict[str, Any] = {k: end for k, end in ends.items() if end > 0.0 and math.isinf(getattr(mounting, k))}
        return replace(mounting, sensor=mounting.sensor or hello.sensor, **missing)

    def _on_plug(self, *, is_there: bool) -> None:
        self.counts.unplugged += not is_there
        self._last_number, self._board_clock = None, BoardClock()

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
            if step < 2**15:  # otherwise the board restarted
                counts.missing += step - 1
        self._last_number = sample.number
        stamp = self._board_clock.stamp(sample.micros, arrival)
        counts.restarts = max(counts.restarts, self._board_clock.restarts)
        if self.hello is None:
            counts.before_hello += 1
            return
        counts.samples += 1
        force = np.array(sample.acceleration) * ACCELERATION_UNITS[self.hello.acceleration_unit]
        # rates first, so that the rotation of the base is known when gravity is filtered
        if sample.rate is not None and self.hello.has_gyroscope:
            self.mailbox.put(stamp, np.array(sample.rate) * RATE_UNITS[self.hello.rate_unit], Kind.ANGULAR_RATE)
        self.mailbox.put(stamp, force, Kind.SPECIFIC_FORCE)
