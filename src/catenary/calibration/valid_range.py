"""Where a model has seen data, and whether it is being asked outside of that."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.kernels import in_lines, inside_rows

BOX_MARGIN = 0.05  # of each feature's range
AXIS_MARGIN = 0.10  # of the range along each principal axis
SMALLEST_RANGE = 1e-6  # [standard deviations] below it a direction counts as not moved at all


@dataclass(frozen=True)
class ValidRange:
    """A box around the training features, and one along their principal axes.

    The first catches a joint beyond where it was, the second combinations that never occurred together:
    large steps where only small ones were seen, a torque on the wrong side of a motion.
    """

    lower: Floats  # (F,) in the features' units
    upper: Floats  # (F,)
    mean: Floats  # (F,)
    axes: Floats  # (F, A) one scaled direction per column: projection = (x - mean) @ axes
    axis_lower: Floats  # (A,)
    axis_upper: Floats  # (A,)

    def inside(self, X: Floats) -> NDArray[np.bool_]:
        """Whether each row of features (N, F) lies within both boxes, (N,); never true for NaN."""
        count, axes = self.axes.shape
        rows = as_array("features", X, (None, count), finite=False)
        out = np.empty(len(rows), dtype=bool)
        inside_rows(rows, axes, self.pack(), np.empty(count + axes), out)
        return out

    def pack(self) -> Floats:
        """Give the arrays one after the other, as compiled loops take them.

        Raises:
            InputError: Their shapes do not fit together.
        """
        count, axes = self.axes.shape
        shapes = {"lower": (count,), "upper": (count,), "mean": (count,), "axes": (count, axes)}
        shapes |= {"axis_lower": (axes,), "axis_upper": (axes,)}
        return in_lines([as_array(name, getattr(self, name), shape) for name, shape in shapes.items()])


def fit_valid_range(X: Floats) -> ValidRange:
    """Describe where training features (N, F) lie, with a small margin."""
    mean, scale = X.mean(axis=0), X.std(axis=0)
    moved = scale > 0.0
    scaled = np.where(moved, scale, 1.0)
    _, _, Vt = np.linalg.svd((X - mean) / scaled, full_matrices=False)
    axes = Vt.T / scaled[:, None]
    lower, upper = X.min(axis=0), X.max(axis=0)
    margin = BOX_MARGIN * (upper - lower) + SMALLEST_RANGE * scaled
    projection = (X - mean) @ axes
    axis_lower, axis_upper = projection.min(axis=0), projection.max(axis=0)
    axis_margin = AXIS_MARGIN * (axis_upper - axis_lower) + SMALLEST_RANGE
    return ValidRange(
        lower=lower - margin,
        upper=upper + margin,
        mean=mean,
        axes=axes,
        axis_lower=axis_lower - axis_margin,
        axis_upper=axis_upper + axis_margin,
    )
