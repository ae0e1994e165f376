"""Where a model has seen data, and whether it is being asked outside of that."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.kernels import in_lines, inside_rows
from catenary.calibration.linear import standardisation

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
    axes: Floats  # (F, F) one scaled direction per column: projection = (x - mean) @ axes
    axis_lower: Floats  # (F,)
    axis_upper: Floats  # (F,)

    def inside(self, X: Floats) -> NDArray[np.bool_]:
        """Whether each row of features (N, F) lies within both boxes, (N,); never true for NaN."""
        count, axes = self.axes.shape
        rows = as_array("features", X, (None, count), finite=False)
        out = np.empty(len(rows), dtype=bool)
        work = in_lines([np.zeros(count), np.zeros(axes)])
        inside_rows(rows.ravel(), count, axes, self.pack(), work, out)
        return out

    def pack(self) -> Floats:
        """Give the arrays one after the other, as compiled loops take them.

        Raises:
            InputError: Their shapes do not fit together.
        """
        count, axes = self.axes.shape
        shapes = {"lower": (count,), "upper": (count,), "mean": (count,), "axes": (count, axes)}
        shapes |= {"axis_lower": (axes,), "axis_upper": (axes,)}
        arrays = [as_array(name, getattr(self, name), shape) for name, shape in shapes.items()]
        return in_lines([*arrays[:4], np.zeros(axes), *arrays[4:]])


def fit_valid_range(X: Floats, margin: float) -> ValidRange:
    """Describe where training features (N, F) lie, and how far beyond a model may go: `margin` times their range."""
    mean, scale = standardisation(X)
    # all F axes, also those along which the rows do not differ; R has them, and is small
    R = np.linalg.qr((X - mean) / scale, mode="r")
    _, _, Vt = np.linalg.svd(R, full_matrices=True)
    axes = Vt.T / scale[:, None]
    lower, upper = X.min(axis=0), X.max(axis=0)
    box_margin = margin * (upper - lower) + SMALLEST_RANGE * scale
    projection = (X - mean) @ axes
    axis_lower, axis_upper = projection.min(axis=0), projection.max(axis=0)
    axis_margin = margin * (axis_upper - axis_lower) + SMALLEST_RANGE
    return ValidRange(
        lower=lower - box_margin,
        upper=upper + box_margin,
        mean=mean,
        axes=axes,
        axis_lower=axis_lower - axis_margin,
        axis_upper=axis_upper + axis_margin,
    )
