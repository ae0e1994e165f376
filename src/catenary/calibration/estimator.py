"""A calibration as an estimator of scikit-learn, for its cross-validation, searches of parameters and pipelines."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from catenary.arrays import Floats
from catenary.calibration.calibration import fit
from catenary.calibration.model_kinds import LEARNED
from catenary.errors import InputError
from catenary.plant import MotionLog, nameless


class CalibrationRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):  # type: ignore[misc]  # has no types
    """Estimator of true joint positions from a robot's reports, row by row in the order of time.

    X (N, F) holds the reported positions [rad|m] of the joints of y, in its order, then any further signals; y (N,) or
    (N, n) the true positions. Parameters are those of `catenary.fit`; units are "rad" where None. `calibration_` is the
    `Calibration`, which has intervals and the rest.

    Rows remember the ones before. Split recordings by time (`GroupKFold`, `TimeSeriesSplit`), never by single rows.
    """

    def __init__(
        self,
        model: Any = LEARNED,
        *,
        units: Sequence[str] | None = None,
        play: Sequence[float] | None = None,
        ridge: float | None = None,
        max_error: Sequence[float] | None = None,
        folds: int = 0,
        seed: int = 0,
        accept: Sequence[str] = (),
    ) -> None:
        self.model, self.units, self.play, self.ridge = model, units, play, ridge
        self.max_error, self.folds, self.seed, self.accept = max_error, folds, seed, accept

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Fit to positions and signals X (N, F), and true positions y (N,) or (N, n) [rad|m]; errors of `fit`."""
        rows, true = validate_data(
            self, X, y, multi_output=True, y_numeric=True, dtype=np.float64, ensure_min_samples=2
        )
        self._is_flat, truth = true.ndim == 1, np.asarray(true, dtype=np.float64).reshape(len(rows), -1)
        if truth.shape[1] > rows.shape[1]:
            raise InputError(
                f"X: expected a reported position for each of {truth.shape[1]} joints, got {rows.shape[1]} columns"
            )
        log, parameters = self._log(rows, truth.shape[1], truth), self.get_params(deep=False)
        del parameters["units"]  # the log has them
        self.calibration_ = fit(log, inputs=["q", *log.signals], **parameters)
        return self

    def predict(self, X: ArrayLike) -> Floats:
        """Return true positions (N,) or (N, n) [rad|m], as y was, of reported positions and signals X (N, F)."""
        check_is_fitted(self)
        rows = validate_data(self, X, reset=False, dtype=np.float64)
        q = self.calibration_.predict(self._log(rows, len(self.calibration_.joint_names)))
        return q[:, 0] if self._is_flat else q

    def _log(self, X: Floats, joints: int, y: Floats | None = None) -> MotionLog:
        units = ("rad",) * joints if self.units is None else tuple(self.units)
        signals = {f"signal{k + 1}": column for k, column in enumerate(X[:, joints:].T)}
        ok = np.ones(len(X), dtype=bool)
        return MotionLog("X", nameless(joints), units, X[:, :joints], ok, y, signals=signals)
