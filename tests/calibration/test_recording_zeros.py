"""Zeros of recordings whose truth is known, and the days that a fit was not shown."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.recording_zeros import recording_zeros
from catenary.plant import MotionLog
from recordings import fitted

ZEROS = np.array([0.3, -0.2, -0.1, 0.1, -0.1, -0.3, 0.2, 0.1, 0.0, 0.2, -0.2, 0.0])


def days(rng: np.random.Generator, zeros: np.ndarray, apart: float, rows: int = 400):
    """Rows of recordings about places `apart`, whose error is 2 x and a zero of each."""
    number = np.repeat(np.arange(len(zeros)), rows)
    x = rng.normal(size=len(number)) + apart * (number % 3)
    return x[:, None], (2.0 * x + zeros[number] + 0.05 * rng.normal(size=len(number)))[:, None], number


def test_zeros_are_found_beside_what_recordings_share(rng) -> None:
    X, Y, recording = days(rng, ZEROS, apart=0.5)
    assert_allclose(recording_zeros(X, Y, recording)[:, 0], ZEROS, atol=0.02)  # noise .05 over 400 rows, and slopes


def test_zeros_are_of_the_mean_row(rng) -> None:
    X, Y, recording = days(rng, ZEROS, apart=0.5)
    kept = (recording != 0) | (np.arange(len(X)) % 4 == 0)  # a quarter of the first
    zeros = recording_zeros(X[kept], Y[kept], recording[kept])
    assert_allclose(zeros[recording[kept]].mean(), 0.0, atol=1e-12)


@pytest.mark.parametrize("load", [0.1, 1.0])
def test_what_an_input_tells_is_no_zero(rng, load) -> None:
    # each recording holds one load throughout: what it does must stay a slope, or another load is not predicted
    number = np.repeat(np.arange(12), 200)
    held = load * rng.permutation(12)[number]
    X = np.column_stack([rng.normal(size=len(number)), held])
    Y = (X @ [0.5, 3.0] + 0.05 * rng.normal(size=len(number)))[:, None]
    left = Y - recording_zeros(X, Y, number)[number]
    slope = np.linalg.lstsq(np.column_stack([X, np.ones(len(X))]), left, rcond=None)[0][1, 0]
    assert slope == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize("recordings", [1, 2])
def test_fewer_than_three_tell_nothing(rng, recordings) -> None:
    X, Y, recording = days(rng, ZEROS[:recordings], apart=0.0)
    assert not recording_zeros(X, Y, recording).any()


def test_another_day_is_predicted_better(rng) -> None:
    # joints turn about another place each day, so that a zero left in is taken for a slope
    def day(k: int, zero: float, rows: int = 300) -> MotionLog:
        q = rng.uniform(-0.5, 0.5, (rows, 2)) + 0.4 * (k % 3 - 1)
        error = 0.1 * q + [zero, 0.0] + 1e-3 * rng.normal(size=q.shape)
        time = 0.4 * np.arange(rows)
        return MotionLog(f"day {k}", ("J1", "J2"), ("rad", "rad"), q, np.ones(rows, dtype=bool), q + error, time)

    logs, later = [day(k, zero) for k, zero in enumerate(0.1 * ZEROS)], day(1, 0.0)
    left = later.q_encoder[:, 0] - fitted(*logs).calibrate(later)[:, 0]
    assert left.std() < 1.2e-3  # [rad] about that day's zero; noise is 1e-3
