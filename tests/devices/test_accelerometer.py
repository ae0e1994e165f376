import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.devices.accelerometer import SerialAccelerometer
from catenary.errors import SensorError
from catenary.sensing.checks import Fault, SensorRules
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Kind, Mailbox, ReadingStatus
from oracles.simulated_board import SimulatedBoard, framed
from patience import PATIENCE, until


@pytest.fixture
def board(tmp_path: Path) -> Iterator[SimulatedBoard]:
    board = SimulatedBoard(tmp_path / "board")
    yield board
    board.close()


def opened(board, mailbox=None, **options):
    return SerialAccelerometer(str(board.link), Mailbox() if mailbox is None else mailbox, **options)


def taken(mailbox):
    return [mailbox.take() for _ in range(len(mailbox))]


def test_samples_arrive_in_si_units_with_rates_and_stamps(board):
    with opened(board) as device:
        until(lambda: b"?" in board.asked())
        board.hello()
        assert device.wait_ready(PATIENCE).sensor == "simulated"
        begin = time.monotonic()
        for k in range(5):
            board.write(board.line((0.1 * k, 0.0, 9.8), (0.0, 0.2, 0.0)))
        until(lambda: device.counts.samples == 5)
        samples = taken(device.mailbox)
    force = [s for s in samples if s.kind is Kind.SPECIFIC_FORCE]
    rates = [s for s in samples if s.kind is Kind.ANGULAR_RATE]
    assert_allclose([s.vector for s in force], [[0.1 * k, 0.0, 9.8] for k in range(5)], atol=1e-5)
    assert_allclose([s.vector for s in rates], np.tile([0.0, 0.2, 0.0], (5, 1)), atol=1e-5)
    # sent within no time: each was taken no later than it arrived
    assert begin - 0.1 < force[0].stamp < time.monotonic()


def test_the_unit_that_the_board_states_is_converted(tmp_path):
    board = SimulatedBoard(tmp_path / "board", unit="g", gyroscope=False)
    with opened(board) as device:
        board.hello()
        board.write(board.line((0.0, 0.0, 1.0)))
        until(lambda: device.counts.samples == 1)
        assert_allclose(taken(device.mailbox)[0].vector, [0.0, 0.0, 9.80665])
        assert device.with_ranges(Mounting()).acceleration_range == pytest.approx(2.0 * 9.80665)
    board.close()


def test_samples_of_an_unknown_unit_are_left_out_and_told_where_no_hello_comes(board):
    with opened(board) as device:
        board.write(board.line() + b"noise\n")
        until(lambda: device.counts.damaged == 1)
        assert len(device.mailbox) == 0
        with pytest.raises(
            SensorError, match=r"no hello within 0.05 s: 1 samples, 1 damaged lines; .*115200 baud"
        ):
            device.wait_ready(0.05)


def test_lines_of_wrong_checksums_and_wrong_content_are_told_apart(board):
    with opened(board) as device:
        board.hello()
        board.write(board.line().replace(b"9.81", b"9.91"))
        board.write(framed("CATAC,1,2,3"))  # whole, but no sample
        board.write(board.line())
        until(lambda: device.counts.samples == 1)
        assert (device.counts.damaged, device.counts.malformed) == (1, 1)
        assert "CATAC with 3 fields" in device.complaint


def test_samples_that_are_missing_or_repeated_are_counted(board):
    board.count = 65534  # the counter wraps meanwhile
    with opened(board) as device:
        board.hello()
        lines = [board.line() for _ in range(8)]
        for k in (0, 1, 1, 2, 5, 6, 6, 7):
            board.write(lines[k])
        until(lambda: device.counts.samples == 6)
        assert (device.counts.missing, device.counts.repeated) == (2, 2)


def test_gravity_lives_through_unplugging_and_plugging_in_again(board):
    mailbox = Mailbox()
    source = SensedGravity(mailbox, rules=SensorRules(stuck_samples=0), angular=False)
    rng = np.random.default_rng(0)
    board.speak(lambda t: (0.5, 0.0, 9.8) + 0.01 * rng.normal(size=3))

    def said():
        return source.read(time.monotonic())

    with opened(board, mailbox) as device:
        until(lambda: said().status is ReadingStatus.LIVE)
        board.unplug()
        until(lambda: (now := said()).status is ReadingStatus.FALLBACK and Fault.INTERRUPTED in now.faults)
        board.plug()
        until(lambda: said().status is ReadingStatus.LIVE)
        assert_allclose(said().gravity, [-0.5, 0.0, -9.8], atol=0.1)
        assert device.counts.unplugged == 1
