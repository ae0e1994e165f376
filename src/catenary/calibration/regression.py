"""Fits by regression: a fixed offset, a linear function, a polynomial of second order."""

import numpy as np
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.preprocessing import PolynomialFeatures

from catenary.arrays import Floats
from catenary.calibration.predictors import Constant, Linear, Quadratic
from catenary.calibration.valid_range import standardisation


def fit_offset(Y: Floats) -> Constant:
    """Fit the mean of Y (N, m): the paper's baseline, the average bias over the training data."""
    return Constant(Y.mean(axis=0))


def fit_linear(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Linear:
    """Fit Y (N, m) as a linear function of the features X (N, F).

    Minimises ||Y - X W - b||^2 + ridge ||W||^2 on standardised X. Where the data do not determine W
    (a joint that never moved), the smallest W is taken; the valid range keeps it from being asked there.
    """
    mean, scale = standardisation(X)
    weights, bias = _least_squares((X - mean) / scale, Y, ridge)
    weights /= scale[:, None]
    return Linear(weights, bias - mean @ weights)


def fit_polynomial(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Quadratic:
    """Fit Y (N, m) as a second-order polynomial of the features X (N, F).

    Ordinary least squares as in the paper when `ridge` is 0; otherwise ridge regression on the standardised
    monomials, which features with memory need: 42 features have 945 monomials.
    """
    mean, scale = standardisation(X)
    monomials = PolynomialFeatures(2, include_bias=False).fit_transform((X - mean) / scale)
    middle, spread = standardisation(monomials)
    weights, bias = _least_squares((monomials - middle) / spread, Y, ridge)
    weights /= spread[:, None]
    n = X.shape[1]
    return Quadratic(mean, scale, weights[:n], weights[n:], bias - middle @ weights)


def _least_squares(Z: Floats, Y: Floats, ridge: float) -> tuple[Floats, Floats]:
    """Return weights (F, m) and bias (m,) of a regression on standardised features."""
    regression = Ridge(alpha=ridge) if ridge > 0.0 else LinearRegression()
    fitted = regression.fit(Z, Y)
    weights = np.asarray(fitted.coef_, dtype=float).reshape(Y.shape[1], -1).T
    return np.array(weights, order="C"), np.asarray(fitted.intercept_, dtype=float).reshape(-1)
