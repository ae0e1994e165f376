"""Bias, scale and mounting of an accelerometer that rested in known orientations, of a whole robot or of its arm."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.sensing.mounting import Mounting
from catenary.sensing.tumble import align
from catenary.spatial import STANDARD_GRAVITY

FEWEST = 4  # orientations: rotation and bias are six numbers, of which one rest gives three
SCALED = 9  # from which on scale is fitted too
_GOOD = 0.1  # [m/s2]
_SPREAD = 0.05  # least share of a direction that the orientations must differ in, of the largest


@dataclass(frozen=True)
class OrientationFit:
    """Errors of a sensor by rests in known orientations: reading = scale (R^T up g) + bias."""

    rotation: Floats  # (3, 3) from the sensor's axes to those that up was told in
    bias: Floats  # (3,) [m/s2]
    scale: Floats  # (3,) ones where they were not fitted
    residual: float  # [m/s2] RMS of what is left of a reading
    faults: tuple[str, ...]  # why the numbers must not be used

    def mounting(self, start: Mounting | None = None, rate_bias: Floats | None = None) -> Mounting:
        """Return a mounting with what was found, and the rest as it was at the start."""
        old = Mounting() if start is None else start
        found = replace(old, rotation=self.rotation, bias=self.bias, scale=self.scale)
        return found if rate_bias is None else replace(found, rate_bias=rate_bias)


def fit_orientations(readings: ArrayLike, up: ArrayLike) -> OrientationFit:
    """Fit rotation and bias, from nine orientations on scale too, to means at rest in known orientations.

    Minimises sum_i |s (R^T up_i g) + b - y_i|^2, beginning at Kabsch's rotation without bias. Without scale it is 1.

    Args:
        readings: (N, 3) means at rest [m/s2], N >= 4.
        up: (N, 3) where up was, in the axes to which the rotation leads.

    Raises:
        InputError: Fewer than four, other shapes, or orientations that do not tell bias from rotation.
    """
    y = as_array("readings", readings, (None, 3))
    told = as_array("up", up, (len(y), 3))
    if len(y) < FEWEST:
        raise InputError(f"orientations: expected at least {FEWEST} rests, got {len(y)}")
    told = told / np.linalg.norm(told, axis=1, keepdims=True)
    spread = np.linalg.svd(told - told.mean(axis=0), compute_uv=False)
    if spread[1] < _SPREAD * np.sqrt(len(y)):
        raise InputError(
            "orientations: up moved along one line at most: tilt about two axes, by 10 degrees or more"
        )
    with_scale = len(y) >= SCALED and spread[2] > _SPREAD * np.sqrt(len(y))

    def off(p: Floats) -> Floats:
        R, scale = Rotation.from_rotvec(p[:3]), p[6:9] if with_scale else np.ones(3)
        left: Floats = scale * R.inv().apply(STANDARD_GRAVITY * told) + p[3:6] - y
        return left.ravel()

    turned = Rotation.from_matrix(align(y, told).rotation).as_rotvec()
    first = np.r_[turned, np.zeros(3), np.ones(3 if with_scale else 0)]
    best = least_squares(off, first, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    residual = float(np.sqrt(np.mean(best.fun**2)))
    faults = []
    if residual > _GOOD:
        faults.append(
            f"residual {residual:.3f} m/s2, expected below {_GOOD:g}: were the orientations as told, in that order?"
        )
    rotation: Floats = Rotation.from_rotvec(best.x[:3]).as_matrix()
    scale = best.x[6:9] if with_scale else np.ones(3)
    return OrientationFit(rotation, best.x[3:6], scale, residual, tuple(faults))
