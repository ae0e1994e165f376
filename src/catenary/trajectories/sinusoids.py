"""Independent random motion: each joint swings between the ends of its range at random speeds.

Joint-calibration paper, section IV-A, "random sinusoidal joint movement": independent joints, target and velocity
drawn for each swing. It is the paper's test motion, and that of its six hours of operation. The paper calls the ranges
predefined and prints none; these are its group's: turning points within 5 deg, 10 deg and 20 mm of the box's ends,
speeds of 1.1 to 3 deg/s, 1.5 to 4 deg/s and 2.5 to 7 mm/s.
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import as_array, as_positive, frozen
from catenary.errors import InputError
from catenary.trajectories.smoothed_path import BrokenLine, SmoothedPath
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER

_TURNING_BANDS = frozen(np.array([np.deg2rad(5.0), np.deg2rad(10.0), 0.02]))  # [rad, rad, m]
SLOWEST_SPEEDS = frozen(np.array([np.deg2rad(1.1), np.deg2rad(1.5), 0.0025]))  # [rad/s, rad/s, m/s]
FASTEST_SPEEDS = frozen(np.array([np.deg2rad(3.0), np.deg2rad(4.0), 0.007]))
_MAX_TIME_S = 1e8  # [s], three years: longer ones are a wrong unit, and exceed the memory
TURN_TIME_S = 1.0  # [s], ours: the paper states that joints slow down, not how


def random_sinusoids(
    rng: np.random.Generator,
    duration: float,
    *,
    lower: ArrayLike = CALIBRATION_LOWER,
    upper: ArrayLike = CALIBRATION_UPPER,
    turning_band: ArrayLike = _TURNING_BANDS,
    slowest: ArrayLike = SLOWEST_SPEEDS,
    fastest: ArrayLike = FASTEST_SPEEDS,
    turn_time: float = TURN_TIME_S,
) -> SmoothedPath:
    """Return an independent random motion of each joint, turning near the ends of its range.

    A joint starts at rest at a random turning point near one end, moves to a random point near the other at a random
    constant speed, decelerates within `turn_time`, turns, and accelerates within `turn_time`. Its last swing ends
    early, so that all joints come to rest at `duration`.

    Args:
        duration: [s], twice `turn_time` to 1e8.
        lower, upper: (n,) ends of the ranges [rad|m]; the RAVEN-II's calibration box by default.
        turning_band: (n,) largest distance of turning points from the ends [rad|m], 0 to half of the range.
        slowest, fastest: (n,) least and largest speed of a swing [rad/s|m/s], positive.
        turn_time: Time to decelerate to rest [s], positive.

    Raises:
        InputError: An argument is outside its range.

    Examples:
        >>> motion = catenary.random_sinusoids(np.random.default_rng(0), 60.0)
        >>> motion(60.0).qd
        array([0., 0., 0.])
    """
    low = as_array("lower", lower, (None,))
    n = len(low)
    high = as_array("upper", upper, (n,))
    band = as_array("turning_band", turning_band, (n,))
    slow, fast = as_array("slowest", slowest, (n,)), as_array("fastest", fastest, (n,))
    total = float(as_array("duration", duration, ()))
    turn = float(as_positive("turn_time", turn_time))
    if n == 0 or not (low < high).all():
        raise InputError(f"lower, upper: expected lower below upper for each joint, got {low} and {high}")
    if not ((0.0 <= band) & (2.0 * band < high - low)).all():
        raise InputError(f"turning_band: expected 0 to less than half of {high - low}, got {band}")
    if not ((0.0 < slow) & (slow <= fast)).all():
        raise InputError(f"slowest, fastest: expected 0 < slowest <= fastest, got {slow} and {fast}")
    if not 2.0 * turn <= total <= _MAX_TIME_S:
        raise InputError(f"duration: expected two turn times, {2.0 * turn:g} s, to {_MAX_TIME_S:g} s, got {total:g}")
    return SmoothedPath([_swings(rng, total, (low[j], high[j]), band[j], (slow[j], fast[j]), turn) for j in range(n)])


def _swings(
    rng: np.random.Generator,
    duration: float,
    ends: tuple[float, float],
    band: float,
    speeds: tuple[float, float],
    turn: float,
) -> BrokenLine:
    """Draw one joint's line, constant for one blend at every turning point, so that the joint comes to rest there."""
    stop = duration - turn  # where the line ends: the motion is at rest one blend later
    end = int(rng.integers(2))

    def turning_point() -> float:
        inwards = rng.uniform(0.0, band)
        return ends[0] + inwards if end == 0 else ends[1] - inwards

    times, points = [0.0], [turning_point()]
    while times[-1] < stop:
        end = 1 - end
        target = turning_point()
        swing = abs(target - points[-1]) / rng.uniform(*speeds)
        share = min(1.0, (stop - times[-1]) / swing)
        points.append(points[-1] + share * (target - points[-1]))
        times.append(min(times[-1] + swing, stop))
        if times[-1] < stop:
            points.append(target)
            times.append(min(times[-1] + turn, stop))
    return BrokenLine(times, points, turn)
