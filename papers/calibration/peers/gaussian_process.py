"""Gaussian process regression of the joint errors, as Mahler et al. calibrate a RAVEN-II (CASE 2014).

One process per joint over the inputs and the velocity, which they found to matter; squared-exponential kernel with a
length per input and white noise, lengths by maximum likelihood. A fit costs the cube of its rows, and each prediction
sums over all of them: 1000 rows, drawn at random, carry a process, 300 of these choose its lengths.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.valid_range import standardisation
from papers.calibration.peers.rows import Places, Rows

CARRIED, CHOSEN = 1000, 300  # rows
SMALLEST_LENGTH, LARGEST_LENGTH = 0.1, 1e3  # of standardised inputs


@dataclass(frozen=True)
class GaussianProcess:
    """A process for each joint, on scaled inputs."""

    processes: tuple[Any, ...]  # scikit-learn's
    mean: Floats
    scale: Floats
    out_mean: Floats
    out_scale: Floats

    def correction(self, rows: Rows, at: Places | None = None) -> Floats:
        """Return what to add to the reported positions of every row, or of rows `at`, (N, n) [rad|m]."""
        Z = (_inputs(rows)[slice(None) if at is None else at] - self.mean) / self.scale
        scaled: Floats = np.column_stack([each.predict(Z) for each in self.processes])
        return self.out_mean + self.out_scale * scaled


def fit_gaussian_process(rows: Rows, *, seed: int, carried: int = CARRIED, chosen: int = CHOSEN) -> GaussianProcess:
    """Fit a process per joint to rows drawn from those with a measurement."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    rng = np.random.default_rng(seed)
    which = np.flatnonzero(rows.known)
    X, Y = _inputs(rows)[which], rows.error[which]
    mean, scale = standardisation(X)
    out_mean, out_scale = standardisation(Y)
    drawn = rng.permutation(len(which))[:carried]
    Z, target = ((X - mean) / scale)[drawn], ((Y - out_mean) / out_scale)[drawn]
    kernel = ConstantKernel(1.0, (1e-2, 1e3)) * RBF(
        np.full(Z.shape[1], 3.0), (SMALLEST_LENGTH, LARGEST_LENGTH)
    ) + WhiteKernel(0.05, (1e-5, 1.0))
    processes = []
    for j in range(Y.shape[1]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound: the input tells nothing
            likely = GaussianProcessRegressor(kernel, alpha=1e-8).fit(Z[:chosen], target[:chosen, j])
        process = GaussianProcessRegressor(likely.kernel_, alpha=1e-8, optimizer=None)
        processes.append(process.fit(Z, target[:, j]))
    return GaussianProcess(tuple(processes), mean, scale, out_mean, out_scale)


def _inputs(rows: Rows) -> Floats:
    return np.hstack((rows.inputs, rows.velocity))
