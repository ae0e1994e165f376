"""The cut-off that suits an inertial unit's noise and a base's rocking, and whether angular terms then help."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.delay_free_filter import CUTOFF_BY_WINDOW
from catenary.spatial import STANDARD_GRAVITY

CUTOFFS = np.geomspace(1.0, 50.0, 60)  # [Hz]
_LEAST = 5  # samples in a window


class CutoffErrors(NamedTuple):
    """What a cut-off does on a base that rocks, as RMS of vectors."""

    cutoff_hz: float
    gravity: float  # [m/s2] noise and distortion
    angular: float  # [rad/s2] the same of the angular acceleration
    rocking: float  # [rad/s2] the angular acceleration itself

    @property
    def angular_helps(self) -> bool:
        """The angular acceleration is better measured than left out."""
        return self.angular < self.rocking


def cutoff_errors(
    cutoff_hz: float, *, angle: float, frequency: float, noise: float, rate_noise: float, rate_hz: float
) -> CutoffErrors:
    """Return the errors of a DelayFreeFilter of that cut-off, at its newest sample.

    The value and the derivative at the end of a least-squares parabola are weighted sums of samples: noise comes out
    as the length of the weights, a sine as their transform.

    Args:
        cutoff_hz: Of the filter.
        angle: Amplitude of the rocking [rad].
        frequency: Of the rocking [Hz].
        noise: Standard deviation of an axis of the accelerometer [m/s2], of a sample.
        rate_noise: The same of the gyroscope [rad/s].
        rate_hz: Of samples.

    Raises:
        InputError: A number that is negative, no frequency, or fewer than five samples in the window.
    """
    for name, number in (("angle", angle), ("noise", noise), ("rate_noise", rate_noise)):
        if not 0.0 <= number < np.inf:
            raise InputError(f"cut-off: {name}: expected 0 or more, got {number}")
    if not (0.0 < frequency < np.inf and 0.0 < cutoff_hz < np.inf and 0.0 < rate_hz < np.inf):
        raise InputError(
            f"cut-off: expected frequencies above 0 Hz, got {cutoff_hz}, {frequency} and {rate_hz}"
        )
    count = int(CUTOFF_BY_WINDOW / cutoff_hz * rate_hz + 1e-9) + 1
    if count < _LEAST:
        raise InputError(
            f"cut-off {cutoff_hz:g} Hz at {rate_hz:g} Hz: expected 5 samples in its window, got {count}"
        )
    ages = -np.arange(count) / rate_hz
    value, slope = np.linalg.pinv(ages[:, None] ** np.arange(3))[:2]
    w = 2.0 * np.pi * frequency
    sine = np.exp(1j * w * ages)
    distorted = STANDARD_GRAVITY * angle * abs(1.0 - value @ sine) / np.sqrt(2.0)
    twisted = angle * w * abs(1j * w - slope @ sine) / np.sqrt(2.0)
    three = np.sqrt(3.0)
    return CutoffErrors(
        float(cutoff_hz),
        float(np.hypot(three * noise * np.linalg.norm(value), distorted)),
        float(np.hypot(three * rate_noise * np.linalg.norm(slope), twisted)),
        float(angle * w * w / np.sqrt(2.0)),
    )


def recommended_cutoff(
    *,
    angle: float,
    frequency: float,
    noise: float,
    rate_noise: float,
    rate_hz: float = 200.0,
    reach: float = 0.5,
) -> CutoffErrors:
    """Return the cut-off with the least error of acceleration at a mass that is `reach` [m] away, and its errors.

    Args:
        angle: Amplitude of the fastest rocking that counts [rad].
        frequency: Its frequency [Hz].
        noise: Standard deviation of an axis of the accelerometer [m/s2], of a sample.
        rate_noise: The same of the gyroscope [rad/s].
        rate_hz: Of samples.
        reach: Distance of what the arm carries from the base [m].

    Raises:
        InputError: As of `cutoff_errors`; or no cut-off leaves five samples.
    """
    given = {
        "angle": angle,
        "frequency": frequency,
        "noise": noise,
        "rate_noise": rate_noise,
        "rate_hz": rate_hz,
    }
    possible: Floats = CUTOFFS[CUTOFF_BY_WINDOW / CUTOFFS * rate_hz >= _LEAST]
    if not len(possible):
        raise InputError(f"cut-off: {rate_hz:g} Hz: too few samples for any")
    tried = [cutoff_errors(float(cutoff), **given) for cutoff in possible]
    return min(tried, key=lambda e: e.gravity**2 + (reach * min(e.angular, e.rocking)) ** 2)
