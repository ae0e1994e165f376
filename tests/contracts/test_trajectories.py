"""What every trajectory owes its callers; a new one joins `TRAJECTORIES`."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.trajectories.cartesian import CartesianSinusoids
from catenary.trajectories.reference import Embedded, InTurn, Rest, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.smoothed_path import SmoothedPath, go_to
from catenary.trajectories.zigzag import _FORMS, CALIBRATION_LOWER, CALIBRATION_UPPER, DIRECTIONS, zigzag

Floats = NDArray[np.float64]

LOW, HIGH = np.array([0.0, 0.9, 0.33]), np.array([1.0, 2.0, 0.42])
BOUNDS = {"max_velocity": [0.5, 0.3, 0.02], "max_acceleration": [1.0, 1.0, 0.1]}
ARM_LOW, ARM_HIGH = np.deg2rad([0.0, 45.0, 0.0]), np.deg2rad([90.0, 135.0, 0.0])
ARM_LOW[2], ARM_HIGH[2] = 0.23, 0.56


def random_rows() -> Floats:
    return np.random.default_rng(3).uniform(LOW, HIGH, (8, 3))


# how to make it, and the range that it promises to stay in; the published paths run 5 % over their box
OVER = 0.06 * (CALIBRATION_UPPER - CALIBRATION_LOWER)
TRAJECTORIES: dict[str, tuple[Callable[[], Trajectory], Floats, Floats]] = {
    **{
        f"zigzag {direction} {form}": (
            lambda direction=direction, form=form: zigzag(
                direction, [1 / 2, 1 / 3] if direction == "J2-J3" else [1 / 2], form=form
            ),
            CALIBRATION_LOWER - OVER,
            CALIBRATION_UPPER + OVER,
        )
        for direction in DIRECTIONS
        for form in (_FORMS if direction == "J1-J2-J3" else _FORMS[:1])
    },
    "random sinusoids": (
        lambda: random_sinusoids(np.random.default_rng(1), 120.0),
        CALIBRATION_LOWER,
        CALIBRATION_UPPER,
    ),
    "cartesian sinusoids": (
        lambda: CartesianSinusoids(load_robot("raven2"), [0.8, 1.6, 0.3]),
        ARM_LOW,
        ARM_HIGH,
    ),
    "go to, together": (lambda: go_to(LOW, HIGH, **BOUNDS), LOW, HIGH),
    "there, a rest, and back": (
        lambda: InTurn([go_to(LOW, HIGH, **BOUNDS), Rest(HIGH, 0.7), go_to(HIGH, LOW, **BOUNDS)]),
        LOW,
        HIGH,
    ),
    "a rest": (lambda: Rest(LOW, 2.0), LOW, HIGH),
    "go to, of some of the joints": (
        lambda: Embedded(go_to(LOW, HIGH, **BOUNDS), [3, 0, 2], [9.0, 0.5, 9.0, 9.0]),
        np.array([LOW[1], 0.5, LOW[2], LOW[0]]),
        np.array([HIGH[1], 0.5, HIGH[2], HIGH[0]]),
    ),
    "go to, nowhere": (lambda: go_to(LOW, LOW, **BOUNDS), LOW, LOW),
    "blends overlapping": (lambda: SmoothedPath.through(np.arange(len(random_rows())), random_rows(), 60.0), LOW, HIGH),
}  # fmt: skip


@pytest.fixture(scope="module", params=TRAJECTORIES)
def case(request: pytest.FixtureRequest) -> tuple[Trajectory, Floats, Floats]:
    make, lower, upper = TRAJECTORIES[request.param]
    return make(), lower, upper


@pytest.fixture(scope="module")
def trajectory(case: tuple[Trajectory, Floats, Floats]) -> Trajectory:
    return case[0]


def test_motion_stays_within_its_range(case: tuple[Trajectory, Floats, Floats]) -> None:
    trajectory, lower, upper = case
    q, _, _ = trajectory.sample(np.linspace(0.0, trajectory.duration, 8001))
    assert (q >= lower - 1e-9).all()
    assert (q <= upper + 1e-9).all()


@pytest.mark.parametrize(
    ("order", "h", "atol"),
    [
        (1, 1e-4, 1e-7),  # central difference: jerk h²/6, at most 50/s3 here, and rounding of 1e-15 / h
        (2, 1e-5, 1e-3),  # where the jerk steps, half of that step times h
    ],
    ids=["velocity", "acceleration"],
)
def test_velocity_and_acceleration_are_derivatives(trajectory, order, h, atol) -> None:
    t = np.linspace(-1.0, trajectory.duration + 1.0, 3001)
    before, after = trajectory.sample(t - h)[order - 1], trajectory.sample(t + h)[order - 1]
    assert_allclose((after - before) / (2.0 * h), trajectory.sample(t)[order], atol=atol)


def test_position_and_velocity_never_leap(trajectory: Trajectory) -> None:
    t = np.linspace(-0.5, trajectory.duration + 0.5, 20001)
    q, qd, qdd = trajectory.sample(t)
    step = t[1] - t[0]
    # the mean value theorem, with the extreme between two samples
    assert (np.abs(np.diff(q, axis=0)) <= 1.1 * step * np.abs(qd).max() + 1e-12).all()
    assert (np.abs(np.diff(qd, axis=0)) <= 1.1 * step * np.abs(qdd).max() + 1e-12).all()


def test_motion_is_at_rest_before_its_start_and_after_its_end(trajectory: Trajectory) -> None:
    for end, times in ((0.0, (-1e9, -1e-3)), (trajectory.duration, (trajectory.duration + 1e-3, 1e9))):
        for t in (end, *times):
            assert_array_equal(trajectory(t).q, trajectory(end).q)
            assert_array_equal(trajectory(t)[1:], 0.0)


def test_duration_is_when_the_motion_comes_to_rest(trajectory: Trajectory) -> None:
    assert np.isfinite(trajectory.duration)
    if trajectory.duration > 0.0 and not isinstance(trajectory, Rest):
        assert np.abs(trajectory(trajectory.duration - 0.01).qd).max() > 0.0


def test_sample_equals_calls(trajectory: Trajectory) -> None:
    times = np.random.default_rng(0).uniform(-1.0, trajectory.duration + 1.0, 60)
    sampled = trajectory.sample(times)
    for k, t in enumerate(times):
        assert_array_equal(trajectory(t), [values[k] for values in sampled])
    n = len(trajectory(0.0).q)
    assert all(values.shape == (0, n) for values in trajectory.sample([]))


@pytest.mark.parametrize("times", [[[0.0]], 0.0, [np.nan], [np.inf], ["now"]])
def test_times_that_are_none_are_refused(trajectory: Trajectory, times: object) -> None:
    with pytest.raises(InputError, match="times"):
        trajectory.sample(times)
    with pytest.raises(InputError):
        trajectory(np.nan)
