"""Linear regression on standardised features."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from sklearn.linear_model import LinearRegression, Ridge

from catenary.arrays import Floats
from catenary.calibration.kernels import LINEAR, Packed, pack, predict_rows


@dataclass(frozen=True)
class Linear:
    """y = X @ weights + bias."""

    kind: ClassVar[str] = "linear"
    weights: Floats  # (F, m) in units of y per unit of the feature
    bias: Floats  # (m,)

    def predict(self, X: Floats) -> Floats:
        """Give (N, m) for features (N, F)."""
        return predict_rows(self.pack(), X)

    def pack(self) -> Packed:
        """Give the arrays as compiled loops take them."""
        inputs, m = self.weights.shape
        parts = [("weights", self.weights, (inputs, m)), ("bias", self.bias, (m,))]
        return pack(LINEAR, parts, sizes=(inputs, m))


def standardisation(X: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation of each column; 1 for a column that does not vary, so that it weighs nothing."""
    mean, scale = X.mean(axis=0), X.std(axis=0)
    return mean, np.where(scale > 1e-12 * (1.0 + np.abs(mean)), scale, 1.0)


def fit_linear(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Linear:
    """Fit Y (N, m) as a linear function of the features X (N, F).

    Minimises ||Y - X W - b||^2 + ridge ||W||^2 on standardised X. Where the data do not determine W
    (a joint that never moved), the smallest W is taken; the valid range keeps it from being asked there.
    """
    mean, scale = standardisation(X)
    regression = Ridge(alpha=ridge) if ridge > 0.0 else LinearRegression()
    fitted = regression.fit((X - mean) / scale, Y)
    weights = np.asarray(fitted.coef_, dtype=float).reshape(Y.shape[1], -1).T / scale[:, None]
    return Linear(weights, np.asarray(fitted.intercept_, dtype=float).reshape(-1) - mean @ weights)
