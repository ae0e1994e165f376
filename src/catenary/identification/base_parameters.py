"""The parameters that torques can show at all: a smallest set of combinations of the links' and the actuation's.

Columns of the regressor are dependent for every motion, because most of a link's inertia moves like its
neighbours'. Numerically (Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic
Systems 8(4), 1991): QR with column pivoting of the regressor over random motions picks independent columns, and says
how the others are combined from them. So tau = Y_b beta, beta = phi_b + K phi_d.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.identification.columns import Parameters

RANDOM_ROWS = 400
DEPENDENT = 1e-8  # of the largest pivot; random motion leaves a gap of eight decades around it


@dataclass(frozen=True)
class BaseParameters:
    """Which columns stay, and what each of them stands for: beta = combination @ phi."""

    parameters: Parameters
    columns: NDArray[np.int64]  # (b,) of the whole regressor, ascending
    combination: Floats  # (b, k)

    @property
    def count(self) -> int:
        """How many parameters can be identified."""
        return len(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' own parameters; what else goes into each is `combination`."""
        return tuple(self.parameters.names[c] for c in self.columns)

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the columns' own parameters."""
        return tuple(self.parameters.units[c] for c in self.columns)

    def regressor(self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> Floats:
        """Matrix (N, n, b) of tau = Y_b beta."""
        return self.parameters.regressor(q, qd, qdd, gravity)[:, :, self.columns]

    def describe(self, index: int) -> str:
        """Write one base parameter as the sum it is."""
        text = self.names[index]
        for column in np.flatnonzero(np.abs(self.combination[index]) > 1e-9):
            if column != self.columns[index]:
                factor = self.combination[index, column]
                text += f" {'+' if factor > 0.0 else '-'} {abs(factor):.5g} {self.parameters.names[column]}"
        return text


def base_parameters(
    parameters: Parameters,
    gravity: Floats,
    recorded: tuple[Floats, Floats, Floats],
    rng: np.random.Generator,
) -> BaseParameters:
    """Find them on random and recorded motion together.

    Args:
        parameters: All parameters.
        gravity: (3,) [m/s2] in base axes.
        recorded: q, qd, qdd, (N, n) each, of what was recorded.
        rng: Source of the random motion.
    """
    model = parameters.model
    low = np.where(np.isfinite(model.lower), model.lower, -2.0)
    high = np.where(np.isfinite(model.upper), model.upper, 2.0)
    size = (RANDOM_ROWS, model.n)
    static = parameters.terms == "static"
    random = [
        rng.uniform(low, high, size),
        np.zeros(size) if static else rng.normal(scale=2.0, size=size),
        np.zeros(size) if static else rng.normal(scale=10.0, size=size),
    ]
    some = np.linspace(0, len(recorded[0]) - 1, min(len(recorded[0]), RANDOM_ROWS)).astype(np.int64)
    motion = [np.concatenate([a, b[some]]) for a, b in zip(random, recorded, strict=True)]
    Y = parameters.regressor(motion[0], motion[1], motion[2], gravity)
    Y = Y.reshape(-1, Y.shape[2])
    size_of = np.linalg.norm(Y, axis=0)
    seen = size_of > DEPENDENT * size_of.max()
    scale = np.where(seen, size_of, 1.0)

    from scipy.linalg import qr

    R, order = qr(Y * (seen / scale), mode="r", pivoting=True)
    pivots = np.abs(np.diag(R))
    rank = int((pivots > DEPENDENT * pivots[0]).sum())
    chosen = np.sort(order[:rank])
    # how the other columns are combined from the chosen ones: least squares is exact for dependent columns
    others = np.setdiff1d(np.arange(Y.shape[1]), chosen)
    ordered = np.hstack([Y[:, chosen] / scale[chosen], Y[:, others] / scale[others]])
    K = np.linalg.lstsq(ordered[:, :rank], ordered[:, rank:], rcond=None)[0]
    combination = np.zeros((rank, Y.shape[1]))
    combination[np.arange(rank), chosen] = 1.0
    combination[:, others] = K * scale[others] / scale[chosen][:, None]
    combination[:, ~seen] = 0.0
    combination[np.abs(combination) < 1e-10] = 0.0  # rounding
    return BaseParameters(parameters, chosen, combination)
