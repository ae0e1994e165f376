"""The valid range of a model: the region of its training data, and a test whether a row is inside."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, Integers, as_array
from catenary.calibration.intervals import MAX_HALF_RANGES, distance_outside
from catenary.cards import StoredFloats
from catenary.kernels.bind import Step
from catenary.kernels.compiled import compiled
from catenary.kernels.row_functions import between, dense, repeat, standardise

MIN_RANGE = 1e-6  # [standard deviations] below it a direction counts as not moved at all
Share = Annotated[float, Field(gt=0.0, le=1.0)]


@dataclass(frozen=True)
class ValidRange:
    """A box around the training features, and one along their principal axes, for combinations never seen."""

    lower: StoredFloats  # (F,) in the features' units
    upper: StoredFloats  # (F,)
    mean: StoredFloats  # (F,)
    axes: StoredFloats  # (F, F) one scaled direction per column: projection = (x - mean) @ axes
    axis_lower: StoredFloats  # (F,)
    axis_upper: StoredFloats  # (F,)
    seen: Share = 1.0  # how far training rows reach, of the way to the edges of the first box
    axes_seen: Share = 1.0  # and of the second

    def __post_init__(self) -> None:
        width = len(self.lower)
        for name, values in list(vars(self).items()):
            if not name.endswith("seen"):
                shape = (width, width) if name == "axes" else (width,)
                object.__setattr__(self, name, as_array(name, values, shape))

    def steps(self, X: Floats, inside: Flags, far: Floats, *, to_edges: bool = False) -> list[Step]:
        """Return steps that clear flags (N,) of rows of X (N, F) outside; `far` (N, 1) is for intervals.py.

        It is 1 at the edges with `to_edges`; else it says of both boxes alike how far training rows reach.
        """
        centred, projection = np.empty_like(X), np.empty_like(X)
        ones, zeros = np.ones(len(self.lower)), np.zeros(len(self.lower))
        middle, half = 0.5 * (self.axis_lower + self.axis_upper), 0.5 * (self.axis_upper - self.axis_lower)
        half *= 1.0 if to_edges else self.axes_seen / self.seen
        return [
            Step(between, (X, self.lower, self.upper), (inside,)),
            Step(standardise, (X, self.mean, ones), (centred,)),
            Step(dense, (centred, self.axes, zeros), (projection,)),
            Step(between, (projection, self.axis_lower, self.axis_upper), (inside,)),
            Step(repeat, (np.zeros(1),), (far,)),
            # along an axis that hardly moved a little is far: beyond the edge, joints tell how far
            Step(distance_outside, (projection, middle - half, middle + half, np.ones(1)), (far,)),
            Step(distance_outside, (X, self.lower, self.upper, np.array([MAX_HALF_RANGES])), (far,)),
        ]


def fit_valid_range(X: Floats, margin: float, *, along_axes: float | None = None) -> ValidRange:
    """Describe where training features (N, F) lie, and how far beyond a model may go: `margin` times their range.

    Along the principal axes it is `along_axes`, `margin` when None.
    """
    along_axes = margin if along_axes is None else along_axes
    mean, scale = standardisation(X)
    # all axes, also those along which the rows do not differ; R has them, and is small
    R = np.linalg.qr((X - mean) / scale, mode="r")
    _, _, Vt = np.linalg.svd(R, full_matrices=True)
    axes = Vt.T / scale[:, None]
    lower, upper = X.min(axis=0), X.max(axis=0)
    box_margin = margin * (upper - lower) + MIN_RANGE * scale
    projection = (X - mean) @ axes
    axis_lower, axis_upper = projection.min(axis=0), projection.max(axis=0)
    axis_margin = along_axes * (axis_upper - axis_lower) + MIN_RANGE
    box, along = (lower - box_margin, upper + box_margin), (axis_lower - axis_margin, axis_upper + axis_margin)
    seen, axes_seen = (1.0 / (1.0 + 2.0 * width) for width in (margin, along_axes))
    return ValidRange(*box, mean, axes, *along, seen=seen, axes_seen=axes_seen)


def standardisation(X: Floats) -> tuple[Floats, Floats]:
    """Return mean and standard deviation of each column; 1 for one that does not vary, so that it weighs nothing."""
    mean, scale = X.mean(axis=0), X.std(axis=0)
    return mean, np.where(scale > 1e-12 * (1.0 + np.abs(mean)), scale, 1.0)


@compiled
def choose(
    prediction: Floats,  # (N, m) what is predicted of `joints`; one that is not finite is not to be trusted
    known: Flags,  # (N,) whether the features are inside the valid range
    beyond: Floats,  # (N, 1) leverage beyond what is usual
    farthest: Floats,  # (m,) the largest of it at which a prediction is trusted
    q: Floats,  # (N, n) reported positions; where one is not finite, nothing is known of that joint
    joints: Integers,  # (m,) which of the n joints
    far: Floats,  # (N, 1) see `intervals.distance_outside`
    fade: Floats,  # (2,) from where to where on the way out, by `far` or leverage, it becomes the fixed offset
    adjustment: Floats,  # (4, n) share of q in a prediction; factors of its error and of q, and what is added
    offset: Floats,  # (n,) fixed offsets
    reach: Floats,  # (n,) largest errors that are believed
    lower: Floats,  # (n,) calibrated positions that are believed
    upper: Floats,  # (n,)
    correction: Floats,  # (N, n) receives them
    inside: Flags,  # (N, n) receives whether each is a prediction
) -> None:
    """Write the predicted errors of some joints, or their fixed offset where the prediction is not to be trusted."""
    for row in range(len(q)):
        for k in range(len(joints)):
            joint, position = joints[k], q[row, joints[k]]
            error = adjustment[1, joint] * (prediction[row, k] - adjustment[0, joint] * position)
            error += adjustment[2, joint] * position + adjustment[3, joint]
            trusted = known[row] and beyond[row, 0] <= farthest[k]
            trusted = trusted and np.isfinite(position) and abs(error) <= reach[joint]
            trusted = trusted and lower[joint] <= position + error <= upper[joint]
            correction[row, joint] = error if trusted else offset[joint]
            way = far[row, 0]
            if farthest[k] > 0.0 and beyond[row, 0] > way * farthest[k]:
                way = beyond[row, 0] / farthest[k]
            if trusted and way > fade[0]:
                share = (way - fade[0]) / (fade[1] - fade[0])
                correction[row, joint] += (share if share < 1.0 else 1.0) * (offset[joint] - error)
            inside[row, joint] = trusted
