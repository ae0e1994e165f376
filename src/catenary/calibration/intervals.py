"""How far off a calibrated position may be: half-widths that hold a stated share of the errors, wider outside.

A model carries two numbers a joint. Inside its valid range the half-width is one constant, outside it is at least that
of the fixed offset, which is what the model then gives, and grows with the distance from what it has seen: in
proportion to how many times farther a watched feature is from the middle of its range than the edge is, as if the
offset's error went on growing as it does from the middle to the edge. Beyond FARTHEST times it grows no more.
Where the numbers come from, and what they promise: conformal.py.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Floats, as_array
from catenary.calibration.arithmetic import Flags, Integers
from catenary.cards import StoredFloats
from catenary.errors import InputError
from catenary.kernels.compiled import compiled

FARTHEST = 10.0  # times the distance from the middle of the valid range to its edge


@dataclass(frozen=True)
class Intervals:
    """Half-widths of intervals about calibrated positions."""

    level: Annotated[float, Field(gt=0.0, lt=1.0)]  # share of errors that they are to hold, 0 to 1
    inside: StoredFloats  # (n,) half-width in the valid range [rad|m]
    outside: StoredFloats  # (n,) at its edge, about the fixed offset [rad|m]

    def __post_init__(self) -> None:
        check_level(self.level)
        object.__setattr__(self, "inside", as_array("interval inside", self.inside, (None,)))
        object.__setattr__(self, "outside", as_array("interval outside", self.outside, self.inside.shape))
        if not ((self.inside >= 0.0) & (self.outside >= self.inside)).all():
            raise InputError(
                f"intervals: expected half-widths of 0 or more, none narrower outside; got {self.inside.tolist()} "
                f"inside and {self.outside.tolist()} outside"
            )


def check_level(level: float) -> None:
    """Refuse a level that is no share."""
    if not 0.0 < level < 1.0:
        raise InputError(f"coverage: expected a share between 0 and 1, such as 0.9, got {level}")


@compiled
def distance(X: Floats, lower: Floats, upper: Floats, farthest: Floats, far: Floats) -> None:
    """Write how many times farther from the middle of a box rows are than its edge is: from 1, inside, to `farthest`.

    Args:
        X: (N, F) watched features; one that is NaN is not known to be outside.
        lower: (F,) edges of the box.
        upper: (F,)
        farthest: (1,) the largest number that is given.
        far: (N,) receives the largest over the features.
    """
    for row in range(len(X)):
        far[row] = 1.0
        for k in range(len(lower)):
            reach = 0.5 * (upper[k] - lower[k])
            away = abs(X[row, k] - (lower[k] + reach))
            if away > far[row] * reach:
                far[row] = away / reach if away < farthest[0] * reach else farthest[0]


@compiled
def widen(
    far: Floats,
    leaping: Flags,
    inside: Flags,
    q: Floats,
    joints: Integers,
    near: Floats,
    edge: Floats,
    interval: Floats,
) -> None:
    """Write the half-widths of some joints.

    Args:
        far: (N,) from `distance`.
        leaping: (N,) rows whose motion is none of training's: the half-width is that of the edge.
        inside: (N, n) whether each correction comes from a predictor, inside its valid range.
        q: (N, n) reported positions; where one is not finite, so is the calibrated one, and the interval is NaN.
        joints: (m,) which of the n joints.
        near: (n,) half-widths inside.
        edge: (n,) half-widths at the edge.
        interval: (N, n) receives them.
    """
    for row in range(len(q)):
        for k in range(len(joints)):
            joint = joints[k]
            if inside[row, joint] and not leaping[row]:
                interval[row, joint] = near[joint]
            elif np.isfinite(q[row, joint]):
                interval[row, joint] = edge[joint] * far[row]
            else:
                interval[row, joint] = np.nan
