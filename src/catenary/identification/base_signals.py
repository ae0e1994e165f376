"""Gravity and the base's turning as a recording holds them, row by row: signals of a motion log.

`gravity:x`, `:y`, `:z` [m/s2] is free fall less the acceleration of the base's origin, in base axes, as an
accelerometer there reads it, negated. `base_rate:x` ... [rad/s] is the base's angular velocity, `base_acceleration:x`
... [rad/s2] its derivative; where that is missing it is computed from the rate.
"""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import MotionLog

UNITS = {"gravity": "m/s2", "base_rate": "rad/s", "base_acceleration": "rad/s2"}
LEAST, MOST = 1.0, 30.0  # [m/s2] that gravity on a base can be; beyond it is in another unit


def base_of(log: MotionLog) -> tuple[Floats | None, Floats | None, Floats | None]:
    """Return gravity, angular velocity and angular acceleration of the base, (N, 3) each, where a log has them.

    Raises:
        InputError: An axis is missing, values are not finite, gravity is none or in another unit, or the base turns
            and there is no gravity.
    """
    found = {name: _vector(log, name) for name in UNITS}
    gravity = found["gravity"]
    if gravity is None and any(values is not None for values in found.values()):
        raise InputError(
            f'recording "{log.name}": has rates of the base and no gravity:x, gravity:y, gravity:z'
        )
    if gravity is not None:
        size = float(np.median(np.linalg.norm(gravity, axis=1)))
        if not LEAST < size < MOST:
            raise InputError(
                f'recording "{log.name}": gravity has a size of {size:.3g}, expected m/s2, about 9.8; is it in g?'
            )
    return gravity, found["base_rate"], found["base_acceleration"]


def smoothed_base(
    log: MotionLog, filtered: Sequence[Floats], step: float
) -> tuple[Floats | None, Floats | None]:
    """Return gravity (N, 3) and the base's rates (N, 2, 3) from the filtered signals of `base_of` that there are."""
    names = [name for name, values in zip(UNITS, base_of(log), strict=True) if values is not None]
    signals = dict(zip(names, filtered, strict=True))
    if "base_rate" not in signals and "base_acceleration" not in signals:
        return signals.get("gravity"), None
    rate = signals.get("base_rate")
    if rate is None:
        raise InputError(f'recording "{log.name}": has base_acceleration and no base_rate')
    turning = signals.get("base_acceleration", np.gradient(rate, step, axis=0))
    return signals["gravity"], np.stack([rate, turning], axis=1)


def _vector(log: MotionLog, name: str) -> Floats | None:
    columns = [log.signals.get(f"{name}:{axis}") for axis in "xyz"]
    missing = [axis for axis, column in zip("xyz", columns, strict=True) if column is None]
    if len(missing) == 3:
        return None
    if missing:
        raise InputError(f'recording "{log.name}": {name}:{missing[0]} is missing beside its other axes')
    values: Floats = np.column_stack([column for column in columns if column is not None])
    if not np.isfinite(values).all():
        raise InputError(
            f'recording "{log.name}": {name} is not finite at row {np.argwhere(~np.isfinite(values))[0, 0]}'
        )
    return values
