"""The line protocol of an accelerometer board: one checksummed ASCII line a sample; described in docs/devices.md."""

import math
from typing import NamedTuple

from catenary.errors import InputError

VERSION = 1
ACCELERATION_UNITS = {"m/s2": 1.0, "cm/s2": 0.01, "g": 9.80665, "mg": 0.00980665}  # [m/s2]
RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "none": 0.0}  # [rad/s]
LONGEST = 200  # bytes of a line; what is longer is noise


class Hello(NamedTuple):
    """A board's description of itself, sent when asked and once a second."""

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

    number: int  # of samples, modulo 2^16
    micros: int  # [us] of the board's clock, modulo 2^32
    acceleration: tuple[float, float, float]  # specific force: upwards at rest
    rate: tuple[float, float, float] | None


def checksum(body: str) -> str:
    """Return the exclusive or of all characters between $ and *, as NMEA 0183 has it: two hexadecimal digits."""
    value = 0
    for character in body:
        value ^= ord(character)
    return f"{value:02X}"


def parse_line(line: str) -> Hello | BoardSample:
    """Read a line without its end."""
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
    """A line was damaged on its way: noise, a lost byte, another speed."""


class LineSplitter:
    """Splits bytes, which come in pieces, into lines; noise without line ends is dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """Take bytes, and return the lines that are whole by now, without their ends."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST:
            lines.append(self._rest)  # it will be refused, and counted
            self._rest = b""
        # what is not ASCII fails the checksum
        return [line.strip(b"\r").decode("ascii", errors="replace") for line in lines if line.strip()]


def _hello(fields: list[str]) -> Hello:
    if len(fields) != 7 or int(fields[0]) != VERSION:
        raise InputError(
            f"hello: expected version {VERSION} and 7 fields, got version {fields[:1]}, {len(fields)} fields"
        )
    _, sensor, unit, end, rate_unit, rate_end, rate_hz = fields
    for name, value, choices in (("unit", unit, ACCELERATION_UNITS), ("rate unit", rate_unit, RATE_UNITS)):
        if value not in choices:
            raise InputError(f'hello: {name} "{value}": expected one of {", ".join(choices)}')
    hello = Hello(sensor, unit, float(end), rate_unit, float(rate_end), float(rate_hz))
    if not (hello.acceleration_range > 0.0 and hello.rate_hz > 0.0 and hello.rate_range >= 0.0):
        raise InputError(f"hello: expected positive ranges and rate, got {fields}")
    return hello
