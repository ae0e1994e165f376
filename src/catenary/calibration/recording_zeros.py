"""How far zeros of recordings lie apart: of another homing, or a camera set up again, which no input tells.

Left in, such steps pull on every slope. Yet what differs from one recording to another may be what inputs do tell, as
a load that was held through each of them. So zeros are taken out as far as that predicts recordings better that are
left out, each of whose zeros is not known: a regression on the features, shared by all, has a zero of each recording
whose square is held by a penalty [a random intercept; Laird and Ware 1982], and the penalty is chosen by those errors.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.arithmetic import Integers
from catenary.calibration.fit_options import MEMORY_RIDGE
from catenary.calibration.valid_range import standardisation

HELD = (np.inf, 3000.0, 300.0, 30.0, 3.0)  # penalties that are tried, in rows; the first takes no zeros out
ALIKE = 0.005  # of the errors' logarithm: where it is all one to them, zeros are held least
FEWEST = 3  # recordings: of two, the one that is not left out has no others to differ from
FOLDS = 10  # of recordings
ROWS = 10_000  # of which products are summed at once


def recording_zeros(X: Floats, Y: Floats, recording: Integers) -> Floats:
    """Return the zero of each recording over the rows' mean, (R, m) in units of Y; nothing but 0 for two or fewer.

    Args:
        X: (N, F) features.
        Y: (N, m) what is learnt.
        recording: (N,) number of the recording of each row.
    """
    zeros = np.zeros((int(recording.max()) + 1, Y.shape[1]))
    present, number = np.unique(recording, return_inverse=True)
    if len(present) < FEWEST:
        return zeros
    mean, scale = standardisation(X)
    middle, width = Y.mean(axis=0), X.shape[1] + 1
    sums = np.zeros((len(present), width + Y.shape[1], width + Y.shape[1]))
    for r in range(len(present)):
        here = np.flatnonzero(number == r)
        for rows in np.split(here, range(ROWS, len(here), ROWS)):
            columns = np.hstack([(X[rows] - mean) / scale, np.ones((len(rows), 1)), Y[rows] - middle])
            sums[r] += columns.T @ columns
    fold = np.arange(len(present)) % FOLDS
    errors = np.empty((len(HELD), len(present), Y.shape[1]))
    for k in np.unique(fold):
        for p, held in enumerate(HELD):
            weights, _ = _shared(sums[fold != k], width, held)
            for out in np.flatnonzero(fold == k):
                errors[p, out] = _mean_square(sums[out], weights)
    error = 0.5 * np.log(np.maximum(errors, 1e-30)).mean(axis=1)
    best: Integers = len(HELD) - 1 - (error <= error.min(axis=0) + ALIKE)[::-1].argmax(axis=0)
    for p, held in enumerate(HELD):
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


def _mean_square(sums: Floats, weights: Floats) -> Floats:
    """Return the mean square (m,) that weights (F + 1, m) leave of the rows of which these are the sums."""
    width = len(weights)
    G, M = sums[:width, :width], sums[:width, width:]
    left = np.diag(sums[width:, width:]) - 2.0 * (weights * M).sum(axis=0) + (weights * (G @ weights)).sum(axis=0)
    return np.asarray(left / sums[width - 1, width - 1])
