import itertools
import math
import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.devices.accelerometer import (
    _WRAP_US,
    BoardClock,
    BoardSample,
    ChecksumError,
    Hello,
    SerialAccelerometer,
    checksum,
    parse_line,
)
from catenary.devices.serial_board import LineSplitter
from catenary.errors import InputError, SensorError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.mounting import Mounting
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
        with pytest.raises(SensorError, match=r"no hello within 0.05 s: 1 samples, 1 damaged lines; .*115200 baud"):
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


NUMBER = st.floats(-100.0, 100.0)


def line_of(body):
    return f"${body}*{checksum(body)}"


def sample_line(number, micros, force=(0.0, 0.0, 9.8), rate=None):
    return line_of(f"CATAC,{number},{micros}," + ",".join(f"{v:.5f}" for v in (*force, *(rate or ()))))


def test_the_checksum_is_that_of_nmea():
    # the sentence that NMEA 0183's descriptions show
    assert checksum("GPGLL,5300.97914,N,00259.98174,E,125926,A") == "28"


@given(
    number=st.integers(0, 65535),
    micros=st.integers(0, 2**32 - 1),
    force=st.tuples(NUMBER, NUMBER, NUMBER),
    rate=st.none() | st.tuples(NUMBER, NUMBER, NUMBER),
)
def test_a_sample_is_read_as_it_was_written(number, micros, force, rate):
    read = parse_line(sample_line(number, micros, force, rate))
    assert isinstance(read, BoardSample)
    assert (read.number, read.micros) == (number, micros)
    assert read.acceleration == pytest.approx(force, abs=1e-5)  # five decimals
    assert read.rate == (None if rate is None else pytest.approx(rate, abs=1e-5))


def test_a_hello_is_read_as_it_was_written():
    hello = Hello("MPU-6050", "m/s2", 19.6, "rad/s", 4.36, 100.0)
    assert parse_line(line_of("CATHI,1," + ",".join(map(str, hello)))) == hello


@given(position=st.integers(0, 60), bit=st.integers(0, 6))
def test_any_bit_that_turns_is_noticed(position, bit):
    line = sample_line(17, 123456, (0.1, -0.2, 9.8))
    position %= len(line)
    damaged = line[:position] + chr(ord(line[position]) ^ (1 << bit)) + line[position + 1 :]
    if damaged.upper() != line:  # the checksum's digits may be of either case
        with pytest.raises(ChecksumError):
            parse_line(damaged)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("CATAC,1,2,3,4", "CATAC with 4 fields"),
        ("CATAC,1,2,3,4,5,6", "CATAC with 6 fields"),
        ("CATAC,1,x,3,4,5", "invalid literal"),
        ("CATAC,1,2,3,4,up", "could not convert"),
        ("CATXX,1,2,3,4,5", "CATXX with 5 fields"),
        ("CATHI,2,s,m/s2,19,none,0,100", "expected version 1"),
        ("CATHI,1,s,furlong,19,none,0,100", 'unit "furlong": expected one of m/s2, cm/s2, g, mg'),
        ("CATHI,1,s,g,2,rpm,0,100", 'rate unit "rpm": expected one of rad/s, deg/s, none'),
        ("CATHI,1,s,g,0,none,0,100", "expected positive"),
    ],
)
def test_whole_lines_of_wrong_content_are_refused_in_words(body, said):
    with pytest.raises(InputError, match=said) as caught:
        parse_line(line_of(body))
    assert not isinstance(caught.value, ChecksumError)


def test_numbers_that_are_none_pass_for_the_estimator_to_name():
    read = parse_line(line_of("CATAC,1,2,nan,inf,9.8"))
    assert math.isnan(read.acceleration[0])


@given(cuts=st.lists(st.integers(0, 60), max_size=6))
def test_lines_come_out_whole_however_their_bytes_come_in(cuts):
    text = "".join(f"{sample_line(k, k)}\r\n" for k in range(2)).encode()
    places = sorted({0, len(text), *(min(c, len(text)) for c in cuts)})
    splitter, lines = LineSplitter(), []
    for a, b in itertools.pairwise(places):
        lines += splitter.feed(text[a:b])
    assert [parse_line(line).number for line in lines] == [0, 1]


def test_the_lines_on_the_page_are_lines_of_the_protocol():
    page = (Path(__file__).parents[2] / "docs" / "devices.md").read_text()
    read = [parse_line(line) for line in re.findall(r"^\$CAT.*$", page, re.MULTILINE)]
    assert [type(line) for line in read] == [Hello, BoardSample]


def stamps(taken, arrivals, *, speed=1.0, start=0):
    """What the clock makes of samples taken at host times, on a board whose clock runs at another speed."""
    clock = BoardClock()
    return np.array(
        [clock.stamp(round(start + 1e6 * speed * t) % _WRAP_US, a) for t, a in zip(taken, arrivals, strict=True)]
    )


@pytest.mark.parametrize("speed", [1.0, 0.995, 1.005])
def test_jitter_of_the_line_does_not_reach_the_stamps(speed):
    rng = np.random.default_rng(0)
    taken = np.arange(0.0, 60.0, 0.01)
    arrivals = taken + 0.001 + rng.exponential(0.004, len(taken))
    late = stamps(taken, arrivals, speed=speed) - taken
    # once settled; between two undelayed samples, ten apart, the offset may drift by 1 % of 0.1 s, and more by chance
    assert late[200:].min() > 0.0
    assert late[200:].max() < 0.006
    assert np.std(late[200:]) < 0.001
    assert np.std(arrivals - taken) > 0.003


def test_the_boards_clock_may_wrap():
    taken = np.arange(0.0, 4.0, 0.01)
    assert_allclose(stamps(taken, taken + 0.002, start=_WRAP_US - 2_000_000), taken + 0.002, atol=2e-6)


def test_a_restarted_board_is_followed_and_counted():
    clock = BoardClock()
    for k in range(100):
        clock.stamp(50_000_000 + 10_000 * k, 0.01 * k)
    assert clock.stamp(1000, 3.0) == pytest.approx(3.0)
    assert clock.stamp(11000, 3.01) == pytest.approx(3.01)
    assert clock.restarts == 1


def test_samples_that_come_in_one_piece_are_as_far_apart_as_they_were_taken():
    clock = BoardClock()
    clock.stamp(0, 0.0)
    piece = [clock.stamp(10_000 * k, 0.05) for k in range(1, 6)]
    assert_allclose(np.diff(piece), 0.01, atol=5e-4)  # the offset may drift by 1 % of 50 ms
