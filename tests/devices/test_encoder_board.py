import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.devices.encoder_board import _CONFIRMING_ROWS, _STALE_AFTER_S, EncoderRig
from catenary.errors import SensorError
from oracles.encoder_bench import AWAY, EncoderBench
from patience import until

RIG = EncoderRig()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[EncoderBench]:
    bench = EncoderBench(tmp_path / "encoders")
    yield bench
    bench.close()


def test_before_homing_there_are_counts_and_no_positions(bench):
    bench.send([1, -2, 3])
    reading, (sample,) = bench.driver.reading(), bench.driver.take()
    assert_array_equal(reading.counts, [1, -2, 3])
    assert reading.reason == "not registered: home the robot"
    for found in (reading, sample):
        assert not found.is_valid
        assert np.isnan(found.q_encoder).all()


def test_after_homing_positions_are_those_of_the_counts_from_the_stops(bench):
    bench.home()
    reading = bench.driver.reading()
    assert reading.is_valid
    # 80,000 counts a turn, 5 um a count, 0, 130 deg and 0.572467 m at the stops; means within 50, 20, 20 counts
    q = [3000 / 80_000 * 2 * math.pi, math.radians(130.0 - 4000 / 80_000 * 360.0), 0.572467 - 12_000 * 5e-6]
    assert_allclose(reading.q_encoder, q, atol=2e-3)
    assert np.abs((reading.q_encoder - q) * RIG.counts).max() < 25.0
    bench.driver.take()
    bench.send(AWAY)
    (sample,) = bench.driver.take()
    assert sample.is_valid
    assert_array_equal(sample.q_encoder, reading.q_encoder)


def test_missed_counts_void_the_registration(bench):
    bench.home()
    lost = AWAY + np.array([40_000.0, 0.0, 0.0])
    bench.send(*[lost] * (_CONFIRMING_ROWS - 1))
    assert bench.driver.reading().is_registered
    bench.send(lost)
    reading = bench.driver.reading()
    assert not reading.is_valid
    assert "shoulder by +40000 counts" in reading.reason
    assert reading.reason.endswith("home the robot again")
    assert reading.tally["losses"] == 1


def test_a_board_that_was_unplugged_must_be_homed_again(bench):
    bench.home()
    bench.board.unplug()
    until(lambda: not bench.driver.reading().is_connected)
    reading = bench.driver.reading()
    assert not reading.is_valid
    assert "unplugged" in reading.reason
    bench.board.plug()
    until(lambda: bench.driver.reading().is_connected)
    bench.write(b"1_2\r\n")
    bench.send(AWAY)
    reading = bench.driver.reading()
    assert not reading.is_valid
    assert reading.reason == "the board was unplugged; not registered: home the robot again"
    bench.home()
    assert bench.driver.reading().is_valid
    assert bench.driver.reading().tally["unplugged"] == 1


def test_positions_are_not_valid_when_nothing_comes(bench):
    bench.home()
    bench.now += _STALE_AFTER_S + 0.1
    reading = bench.driver.reading()
    assert not reading.is_valid
    assert reading.is_registered
    assert reading.reason == "no counts for 0.3 s"
    bench.send(AWAY)
    assert bench.driver.reading().is_valid


def test_samples_are_a_period_apart_also_when_they_come_in_one_piece(bench):
    bench.send(*[[0, 0, 0]] * 50)
    bench.driver.take()
    bench.now += 5 * bench.period
    bench.board.write(bench.board.line([0, 0, 0]) * 5)
    until(lambda: bench.driver.tally.rows == 55)
    times = [sample.time for sample in bench.driver.take()]
    assert_allclose(np.diff(times), bench.period, rtol=1e-6)
    assert bench.driver.reading().rate_hz == pytest.approx(100.0, rel=0.01)


def test_a_silent_board_is_told(bench):
    bench.write(b"hello\n")
    with pytest.raises(SensorError, match=r"no row of counts within 0.05 s: 1 other lines .*hello.*a_b_c"):
        bench.driver.wait_ready(0.05)
