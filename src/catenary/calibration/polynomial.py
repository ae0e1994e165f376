"""Second-order polynomial regression on standardised features."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.preprocessing import PolynomialFeatures

from catenary.arrays import Floats
from catenary.calibration.kernels import QUADRATIC, Packed, pack, predict_rows
from catenary.calibration.layers import lines
from catenary.calibration.linear import standardisation


@dataclass(frozen=True)
class Quadratic:
    """y = bias + z @ linear + sum_ij z_i z_j quadratic_ij, z = (x - mean) / scale, i <= j row by row."""

    kind: ClassVar[str] = "quadratic"
    mean: Floats  # (F,)
    scale: Floats  # (F,)
    linear: Floats  # (F, m)
    quadratic: Floats  # (F (F + 1) / 2, m), pairs (0, 0), (0, 1), ..., (1, 1), ...
    bias: Floats  # (m,)

    def predict(self, X: Floats) -> Floats:
        """Give (N, m) for features (N, F)."""
        return predict_rows(self.pack(), X)

    def pack(self) -> Packed:
        """Give the arrays as compiled loops take them."""
        inputs, m = self.linear.shape
        pairs = inputs * (inputs + 1) // 2
        parts = [
            ("mean", self.mean, (inputs,)),
            ("scale", self.scale, (inputs,)),
            ("linear", self.linear, (inputs, m)),
            ("quadratic", self.quadratic, (pairs, m)),
            ("bias", self.bias, (m,)),
        ]
        return pack(QUADRATIC, parts, sizes=(inputs, m), room=lines(inputs + pairs))


def fit_polynomial(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Quadratic:
    """Fit Y (N, m) as a second-order polynomial of the features X (N, F).

    Ordinary least squares as in the paper when `ridge` is 0; otherwise ridge regression on the standardised
    monomials, which features with memory need: 42 features have 945 monomials.
    """
    mean, scale = standardisation(X)
    monomials = PolynomialFeatures(2, include_bias=False).fit_transform((X - mean) / scale)
    middle, spread = standardisation(monomials)
    monomials -= middle
    monomials /= spread
    regression = Ridge(alpha=ridge) if ridge > 0.0 else LinearRegression()
    fitted = regression.fit(monomials, Y)
    weights = np.asarray(fitted.coef_, dtype=float).reshape(Y.shape[1], -1).T / spread[:, None]
    bias = np.asarray(fitted.intercept_, dtype=float).reshape(-1) - middle @ weights
    n = X.shape[1]
    return Quadratic(mean, scale, weights[:n], weights[n:], bias)
