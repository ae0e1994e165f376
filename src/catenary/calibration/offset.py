"""The fixed offset: the mean error, whatever the robot does."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from sklearn.dummy import DummyRegressor

from catenary.arrays import Floats
from catenary.calibration.kernels import CONSTANT, Packed, pack, predict_rows


@dataclass(frozen=True)
class Constant:
    """y = value for any features."""

    kind: ClassVar[str] = "constant"
    value: Floats  # (m,)

    def predict(self, X: Floats) -> Floats:
        """Give (N, m) for features (N, F)."""
        return predict_rows(self.pack(), X)

    def pack(self) -> Packed:
        """Give the arrays as compiled loops take them; features of any number."""
        m = len(self.value)
        return pack(CONSTANT, [("value", self.value, (m,))], sizes=(0, m))


def fit_offset(X: Floats, Y: Floats) -> Constant:
    """Fit the mean of Y (N, m): the paper's baseline, the average bias over the training data."""
    fitted = DummyRegressor(strategy="mean").fit(X, Y)
    return Constant(np.asarray(fitted.constant_, dtype=float).reshape(-1))
