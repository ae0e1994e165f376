"""The two-phase calibration of Seita et al. (ICRA 2018): a network for the coarse part, a random forest for its rest.

There the network maps camera to robot positions and the forest learns from positions that a person corrected. Here
both take the same inputs and learn joint errors: the network is the calibration paper's, the forest of 100 trees
learns what it leaves on the training rows, five rows a leaf at least, each tree from at most 10,000 of them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.neural import PAPER, NetworkSettings, fit_neural
from catenary.calibration.predictors import Network
from catenary.calibration.valid_range import standardisation
from papers.calibration.peers.rows import Places, Rows

TREES, ROWS_OF_A_TREE, LEAF = 100, 10_000, 5


@dataclass(frozen=True)
class TwoPhase:
    """A network, and a forest that corrects it."""

    network: Network
    forest: Any  # scikit-learn's, of residuals over `scale`
    scale: Floats

    def correction(self, rows: Rows, at: Places | None = None) -> Floats:
        """Return what to add to the reported positions of every row, or of rows `at`, (N, n) [rad|m]."""
        X = rows.inputs if at is None else np.ascontiguousarray(rows.inputs[at])
        residual = np.asarray(self.forest.predict(X)).reshape(len(X), -1)
        corrected: Floats = self.network.predict(X) + self.scale * residual
        return corrected


def fit_two_phase(rows: Rows, *, seed: int, settings: NetworkSettings = PAPER, trees: int = TREES) -> TwoPhase:
    """Train the network, then the forest on what it leaves."""
    from sklearn.ensemble import RandomForestRegressor

    which = np.flatnonzero(rows.known)
    X, Y = np.ascontiguousarray(rows.inputs[which]), rows.error[which]
    network = fit_neural(X, Y, settings, seed=seed)
    residual = Y - network.predict(X)
    scale = standardisation(residual)[1]  # rad and m would not count alike in a split
    forest = RandomForestRegressor(
        trees, min_samples_leaf=LEAF, max_samples=min(ROWS_OF_A_TREE, len(X)), random_state=seed, n_jobs=1
    )
    return TwoPhase(network, forest.fit(X, residual / scale), scale)
