"""How far off a calibrated position may be: half-widths that hold a stated share of the errors, wider where none was.

Where training rows lay, a joint's half-width is one constant; that of a regression grows with the leverage of a row
(extrapolation.py). Towards the edge of the valid range it becomes the fixed offset's: in the last tenth of the way, as
the learned model's correction does; of the papers' models from the rows to halfway through the margin, in proportion
to the distance (Meyer and Pebesma, Methods in Ecology and Evolution 12, 2021), which measurement chose. Beyond the edge
it grows as if the offset's error went on as from the middle to the edge, to MAX_HALF_RANGES times. Where the numbers
come from, and what they promise: conformal.py.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, Integers, as_array
from catenary.cards import StoredFloats
from catenary.errors import InputError
from catenary.kernels.compiled import compiled

MAX_HALF_RANGES = 10.0  # times the distance from the middle of the valid range to its edge


@dataclass(frozen=True)
class Intervals:
    """Half-widths of intervals about calibrated positions."""

    level: Annotated[float, Field(gt=0.0, lt=1.0)]  # share of errors that they are to hold, 0 to 1
    inside: StoredFloats  # (n,) half-width where training rows lay [rad|m]
    outside: StoredFloats  # (n,) beyond the edge of the valid range, about the fixed offset [rad|m]

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
def distance_outside(X: Floats, lower: Floats, upper: Floats, farthest: Floats, far: Floats) -> None:
    """Raise how far rows are from the middle of a box, as a share of the way to its edge, to at most `farthest` (1,).

    X (N, F) are watched features or their projections, of which one that is NaN is not known to be far; the box is from
    lower (F,) to upper (F,). `far` (N, 1) holds what other boxes gave, and receives the largest over the features.
    """
    for row in range(len(X)):
        for k in range(len(lower)):
            reach = 0.5 * (upper[k] - lower[k])
            away = abs(X[row, k] - (lower[k] + reach))
            if away > far[row, 0] * reach:
                far[row, 0] = away / reach if away < farthest[0] * reach else farthest[0]


@compiled
def widen(
    far: Floats,  # (N, 1) from `distance_outside`
    leaping: Flags,  # (N,) rows that leap: the half-width is that of the edge
    inside: Flags,  # (N, n) whether each correction comes from a predictor, inside its valid range
    q: Floats,  # (N, n) reported positions; where one is not finite, so is the calibrated one, and the interval is NaN
    joints: Integers,  # (m,) which of the n joints
    beyond: Floats,  # (N, 1) leverage beyond what is usual
    factor: Floats,  # (m,) by which it widens
    near: Floats,  # (n,) half-widths where training rows lay
    edge: Floats,  # (n,) half-widths at the edge
    reach: Floats,  # (2,) from where to where on the way out the half-width becomes that of the edge
    interval: Floats,  # (N, n) receives them
) -> None:
    """Write the half-widths of some joints."""
    for row in range(len(q)):
        for k in range(len(joints)):
            joint = joints[k]
            if inside[row, joint] and not leaping[row]:
                own = near[joint] * math.sqrt(1.0 + factor[k] * factor[k] * beyond[row, 0])
                if far[row, 0] <= reach[0]:
                    interval[row, joint] = own
                elif far[row, 0] >= reach[1]:
                    interval[row, joint] = edge[joint] * (far[row, 0] if far[row, 0] > 1.0 else 1.0)
                else:
                    share = (far[row, 0] - reach[0]) / (reach[1] - reach[0])
                    interval[row, joint] = own + (edge[joint] - own) * share
            elif np.isfinite(q[row, joint]):
                interval[row, joint] = edge[joint] * (far[row, 0] if far[row, 0] > 1.0 else 1.0)
            else:
                interval[row, joint] = np.nan
