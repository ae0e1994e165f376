"""What every board on a serial line must live through: noise, cut lines, counters' ends, lost lines, unplugging."""

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import pytest

from catenary.devices.accelerometer import SerialAccelerometer
from catenary.devices.encoder_board import EncoderBoard
from catenary.devices.encoder_rig import EncoderRig
from catenary.errors import SensorError
from catenary.sensing.mailbox import Mailbox
from oracles.simulated_board import SimulatedBoard
from oracles.simulated_encoders import SimulatedEncoders
from oracles.simulated_port import SimulatedPort
from patience import PATIENCE, until


class Bench(Protocol):
    """A device and its board, in the terms that both share."""

    board: SimulatedPort

    def line(self) -> bytes: ...
    def good(self) -> int: ...
    def bad(self) -> int: ...
    def unplugged(self) -> int: ...
    def connected(self) -> bool: ...
    def close(self) -> None: ...


class AccelerometerBench:
    """Its clock ends after five samples."""

    def __init__(self, link: Path) -> None:
        self.board = SimulatedBoard(link, gyroscope=False, start_us=2**32 - 50_000)
        self.board.count = 65_531
        self.device = SerialAccelerometer(str(link), Mailbox())
        self.board.hello()
        self.device.wait_ready(PATIENCE)

    def line(self) -> bytes:
        return self.board.line()

    def good(self) -> int:
        return self.device.counts.samples

    def bad(self) -> int:
        return self.device.counts.damaged + self.device.counts.malformed

    def unplugged(self) -> int:
        return self.device.counts.unplugged

    def connected(self) -> bool:
        return self.device.is_connected

    def close(self) -> None:
        self.device.close()
        self.board.close()


class EncoderBench:
    """Its counters of 16 bits end after five rows."""

    def __init__(self, link: Path) -> None:
        self.board = SimulatedEncoders(link, bits=16, offset=(32_762, -32_763, 32_760))
        self.device = EncoderBoard(str(link), EncoderRig(bits=16))
        self.row = 0
        self.board.write(b"\n7\n")

    def line(self) -> bytes:
        self.row += 1
        return self.board.line([self.row, -self.row, self.row])

    def good(self) -> int:
        return self.device.tally.rows

    def bad(self) -> int:
        return self.device.tally.malformed

    def unplugged(self) -> int:
        return self.device.tally.unplugged

    def connected(self) -> bool:
        return self.device.reading().is_connected

    def close(self) -> None:
        self.device.close()
        self.board.close()


@pytest.fixture(params=[AccelerometerBench, EncoderBench])
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    bench = request.param(tmp_path / "board")
    yield bench
    bench.close()


def send(bench, count):
    for _ in range(count):
        before = bench.good()
        bench.board.write(bench.line())
        until(lambda before=before: bench.good() > before)


def test_lines_go_on_over_the_ends_of_all_counters(bench):
    send(bench, 20)
    assert (bench.good(), bench.bad()) == (20, 0)


@pytest.mark.parametrize("noise", [b"\xff\x00\xfe\n", b"$*\n", b"___\n", b"x" * 1000 + b"\n", b"1_2_3_4\r\n"])
def test_noise_is_counted_and_the_next_line_is_good(bench, noise):
    send(bench, 3)
    bench.board.write(noise)
    until(lambda: bench.bad() >= 1)
    send(bench, 3)
    assert bench.good() == 6


def test_a_cut_line_costs_no_other(bench):
    send(bench, 3)
    line = bench.line()
    bench.board.write(line[:3] + b"\r\n")
    until(lambda: bench.bad() == 1)
    send(bench, 3)
    assert bench.good() == 6


def test_a_lost_end_of_line_costs_two_lines(bench):
    send(bench, 3)
    bench.board.write(bench.line().rstrip() + bench.line())
    until(lambda: bench.bad() == 1)
    send(bench, 3)
    assert bench.good() == 6


def test_a_few_missed_lines_are_lived_through(bench):
    send(bench, 3)
    for _ in range(5):
        bench.line()
    send(bench, 3)
    assert bench.good() == 6


def test_an_unplugged_board_is_waited_for_twice(bench):
    send(bench, 3)
    for times in (1, 2):
        bench.board.unplug()
        until(lambda: not bench.connected())
        bench.board.plug()
        until(bench.connected)
        assert bench.unplugged() == times
        bench.board.write(b"\n7\n")
        before = bench.good()
        until(lambda before=before: bench.board.write(bench.line()) or bench.good() > before)


@pytest.mark.parametrize("make", [lambda port: SerialAccelerometer(port, Mailbox()), EncoderBoard])
def test_a_port_that_is_not_there_is_told_with_those_that_are(make, tmp_path):
    with pytest.raises(SensorError, match=r"none: cannot be opened: .*; serial ports here: "):
        make(str(tmp_path / "none"))
