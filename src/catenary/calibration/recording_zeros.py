"""The zero of each recording, which no feature explains and no model is to learn.

Zeros are drawn to nothing, by as much as recordings that are left out in turn are then predicted best.
"""

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.calibration.fit_options import MEMORY_RIDGE
from catenary.calibration.valid_range import standardisation

_PENALTIES_ROWS = (np.inf, 3000.0, 300.0, 30.0, 3.0)  # penalties that are tried, in rows; the first takes no zeros out
_ALIKE_LOG_ERROR = 0.005  # of the errors' logarithm: where it is all one to them, zeros are held least
_MIN_RECORDINGS = 3  # recordings: of two, the one that is not left out has no others to differ from
_FOLDS = 10  # of recordings
_SUMMED_ROWS = 10_000  # of which products are summed at once


def recording_zeros(X: Floats, Y: Floats, recording: Integers) -> Floats:
    """Return each recording's zero (R, m) over the mean of Y (N, m), learnt from X (N, F); 0 for two or fewer."""
    zeros = np.zeros((int(recording.max()) + 1, Y.shape[1]))
    present, number = np.unique(recording, return_inverse=True)
    if len(present) < _MIN_RECORDINGS:
        return zeros
    mean, scale = standardisation(X)
    middle, width = Y.mean(axis=0), X.shape[1] + 1
    sums = np.zeros((len(present), width + Y.shape[1], width + Y.shape[1]))
    for r in range(len(present)):
        here = np.flatnonzero(number == r)
        for rows in np.split(here, range(_SUMMED_ROWS, len(here), _SUMMED_ROWS)):
            columns = np.hstack([(X[rows] - mean) / scale, np.ones((len(rows), 1)), Y[rows] - middle])
            sums[r] += columns.T @ columns
    fold = np.arange(len(present)) % _FOLDS
    errors = np.empty((len(_PENALTIES_ROWS), len(present), Y.shape[1]))
    for k in np.unique(fold):
        for p, held in enumerate(_PENALTIES_ROWS):
            weights, _ = _shared(sums[fold != k], width, held)
            for out in np.flatnonzero(fold == k):
                G, M, Y2 = sums[out, :width, :width], sums[out, :width, width:], np.diag(sums[out, width:, width:])
                left = Y2 - 2.0 * (weights * M).sum(axis=0) + (weights * (G @ weights)).sum(axis=0)
                errors[p, out] = left / sums[out, width - 1, width - 1]
    error = 0.5 * np.log(np.maximum(errors, 1e-30)).mean(axis=1)
    best: Integers = len(_PENALTIES_ROWS) - 1 - (error <= error.min(axis=0) + _ALIKE_LOG_ERROR)[::-1].argmax(axis=0)
    for p, held in enumerate(_PENALTIES_ROWS):
        joints = np.flatnonzero(best == p)
        zeros[np.ix_(present, joints)] = _shared(sums, width, held)[1][:, joints]
    return zeros


def _shared(sums: Floats, width: int, held: float) -> tuple[Floats, Floats]:
    """Return weights (F + 1, m) that recordings share, and each one's zero over the rows' mean (R, m)."""
    rows, columns, of_y = sums[:, width - 1, width - 1], sums[:, width - 1, :width], sums[:, width - 1, width:]
    penalty = np.diag(np.append(np.full(width - 1, MEMORY_RIDGE), 1e-9))
    share = 1.0 / (rows + held)  # of a recording's mean error that is its zero
    gram = sums[:, :width, :width].sum(axis=0) - np.einsum("r,rf,rg->fg", share, columns, columns)
    moment = sums[:, :width, width:].sum(axis=0) - np.einsum("r,rf,rm->fm", share, columns, of_y)
    weights = np.linalg.solve(gram + penalty, moment)
    zeros = share[:, None] * (of_y - columns @ weights)
    mean = rows @ zeros / rows.sum()
    weights[width - 1] += mean
    return weights, zeros - mean
