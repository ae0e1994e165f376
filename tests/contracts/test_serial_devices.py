"""What every board on a serial line must live through: noise, cut lines, counters' ends, lost lines, unplugging."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from catenary.devices.accelerometer import SerialAccelerometer
from catenary.devices.encoder_board import EncoderBoard, EncoderRig
from catenary.errors import SensorError
from catenary.sensing.gravity_vector import Mailbox
from oracles.simulated_board import SimulatedBoard
from oracles.simulated_encoders import SimulatedEncoders
from patience import PATIENCE, until


class AccelerometerBench:
    """A device and its board, whose clock ends after five samples."""

    def __init__(self, link: Path) -> None:
        self.board = SimulatedBoard(link, gyroscope=False, start_us=2**32 - 50_000)
        self.board.count = 65_531
        self.device = SerialAccelerometer(str(link), Mailbox())
        self.board.hello()
        self.device.wait_ready(PATIENCE)

    def line(self) -> bytes:
        return self.board.line()

    def counts(self) -> tuple[int, int, int]:
        """Good lines, bad ones, times unplugged."""
        counts = self.device.counts
        return counts.samples, counts.damaged + counts.malformed, counts.unplugged


class EncoderBench:
    """A device and its board, whose counters of 16 bits end after five rows."""

    def __init__(self, link: Path) -> None:
        self.board = SimulatedEncoders(link, bits=16, offset=(32_762, -32_763, 32_760))
        self.device = EncoderBoard(str(link), EncoderRig(bits=16))
        self.row = 0
        self.board.write(b"\n7\n")

    def line(self) -> bytes:
        self.row += 1
        return self.board.line([self.row, -self.row, self.row])

    def counts(self) -> tuple[int, int, int]:
        """Good lines, bad ones, times unplugged."""
        tally = self.device.tally
        return tally.rows, tally.malformed, tally.unplugged


@pytest.fixture(params=[AccelerometerBench, EncoderBench])
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Any]:
    bench = request.param(tmp_path / "board")
    yield bench
    bench.device.close()
    bench.board.close()


def send(bench: Any, count: int = 3) -> None:
    for _ in range(count):
        before = bench.counts()[0]
        bench.board.write(bench.line())
        until(lambda before=before: bench.counts()[0] > before)


def test_lines_go_on_over_the_ends_of_all_counters(bench: Any) -> None:
    send(bench, 20)
    assert bench.counts() == (20, 0, 0)


@pytest.mark.parametrize(
    "damaged",
    [
        *(lambda line, noise=noise: noise for noise in (b"\xff\x00\xfe\n", b"$*\n", b"___\n", b"x" * 1000 + b"\n")),
        lambda line: b"1_2_3_4\r\n",
        lambda line: line()[:3] + b"\r\n",
        lambda line: line().rstrip() + line(),
    ],
    ids=["noise", "frame only", "separators only", "long", "one more number", "cut", "end of line lost"],
)
def test_damage_is_counted_and_costs_no_other_line(bench: Any, damaged: Any) -> None:
    send(bench)
    bench.board.write(damaged(bench.line))
    until(lambda: bench.counts()[1] >= 1)
    send(bench)
    assert bench.counts()[0] == 6


def test_a_few_missed_lines_are_lived_through(bench: Any) -> None:
    send(bench)
    for _ in range(5):
        bench.line()
    send(bench)
    assert bench.counts() == (6, 0, 0)


def test_an_unplugged_board_is_waited_for_twice(bench: Any) -> None:
    send(bench)
    for times in (1, 2):
        bench.board.unplug()
        until(lambda: not bench.device.is_connected)
        bench.board.plug()
        until(lambda: bench.device.is_connected)
        assert bench.counts()[2] == times
        bench.board.write(b"\n7\n")
        before = bench.counts()[0]
        until(lambda before=before: bench.board.write(bench.line()) or bench.counts()[0] > before)


@pytest.mark.parametrize("make", [lambda port: SerialAccelerometer(port, Mailbox()), EncoderBoard])
def test_a_port_that_is_not_there_is_told_with_those_that_are(make, tmp_path):
    with pytest.raises(SensorError, match=r"none: cannot be opened: .*; serial ports here: "):
        make(str(tmp_path / "none"))
