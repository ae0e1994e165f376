import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.sinusoids import _TURNING_BANDS, FASTEST_SPEEDS, SLOWEST_SPEEDS, random_sinusoids
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER


def test_joints_turn_near_the_ends_of_their_ranges_and_cross_at_random_speeds(rng) -> None:
    motion = random_sinusoids(rng, 7200.0)
    q, qd, _ = motion.sample(np.arange(0.0, 7200.0, 0.05))
    assert (q >= CALIBRATION_LOWER).all()
    assert (q <= CALIBRATION_UPPER).all()
    for j in range(3):
        turns = np.flatnonzero(qd[1:, j] * qd[:-1, j] < 0.0)
        assert len(turns) > 100
        from_ends = np.minimum(q[turns, j] - CALIBRATION_LOWER[j], CALIBRATION_UPPER[j] - q[turns, j])
        assert from_ends.max() <= _TURNING_BANDS[j]
        speed = np.abs(qd[:, j])
        assert 0.9 * FASTEST_SPEEDS[j] < speed.max() <= FASTEST_SPEEDS[j] * (1.0 + 1e-9)
        assert np.mean(speed[speed > 0.0] < SLOWEST_SPEEDS[j]) < 0.1  # only while turning


def test_joints_move_independently(rng: np.random.Generator) -> None:
    q, _, _ = random_sinusoids(rng, 21600.0).sample(np.arange(0.0, 21600.0, 1.0))
    correlation = np.corrcoef(q.T)[np.triu_indices(3, 1)]
    assert np.abs(correlation).max() < 0.2  # some 700 swings each


def test_same_seed_gives_the_same_motion() -> None:
    first, again, other = (random_sinusoids(np.random.default_rng(seed), 600.0) for seed in (1, 1, 2))
    times = np.linspace(0.0, 600.0, 101)
    assert_array_equal(first.sample(times)[0], again.sample(times)[0])
    assert not np.array_equal(first.sample(times)[0], other.sample(times)[0])


@pytest.mark.parametrize("duration", [2.0, 2.5, 30.0, 31.0, 1200.0])
def test_duration_is_what_was_asked_for(rng: np.random.Generator, duration: float) -> None:
    for _ in range(20):
        assert random_sinusoids(rng, duration).duration == pytest.approx(duration, rel=1e-12)


def test_any_joints_will_do(rng: np.random.Generator) -> None:
    motion = random_sinusoids(
        rng, 60.0, lower=[-1.0], upper=[2.0], turning_band=[0.0], slowest=[0.5], fastest=[0.5], turn_time=0.2
    )
    q, qd, _ = motion.sample(np.arange(0.0, 60.0, 0.001))
    assert q.min() == pytest.approx(-1.0, abs=1e-12)
    assert q.max() == pytest.approx(2.0, abs=1e-12)
    assert np.abs(qd).max() == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration": 1.9}, "expected two turn times, 2 s"),
        ({"duration": 1e30}, "to 1e\\+08 s"),
        ({"duration": np.nan}, "duration"),
        ({"turn_time": 0.0}, "turn_time"),
        ({"lower": [0.0, 0.0, 0.5]}, "lower below upper"),
        ({"lower": [], "upper": [], "turning_band": [], "slowest": [], "fastest": []}, "lower"),
        ({"upper": [1.0, 2.0]}, r"upper: expected shape \(3,\)"),
        ({"turning_band": [0.5, 0.1, 0.01]}, "turning_band: expected 0 to less than half"),
        ({"slowest": [0.0, 0.1, 0.1]}, "0 < slowest <= fastest"),
    ],
)
def test_bad_arguments_are_refused(rng, arguments, message) -> None:
    with pytest.raises(InputError, match=message):
        random_sinusoids(rng, **{"duration": 60.0, **arguments})
