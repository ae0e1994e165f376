"""How far the masses of a robot's file may be from the true ones, before a recording is looked at.

They are wrong by unknown shares, c of all parts of a link alike, s each by itself: P = c^2 phi phi^T + s^2 D, where D
has the square of .3 of a link's size in each of its ten parameters. s is .1, .3 or 1. An arm without masses has links
of about 1 kg and .1 m.
"""

from collections.abc import Iterator

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters
from catenary.identification.base_parameters import Parameters

SPREADS = ((0.1, 0.1, 0.3), (0.3, 0.15, 0.5), (1.0, 0.3, 0.2))  # s, c, and how likely that is
_EXACT = (0.01, 0.2, 0.3)  # of a file whose masses are all wrong by one factor, if at all
MASS_SHARE = 0.3  # of a link's mass, that a spread of one is
_FREE_MASS, _FREE_LENGTH_M = 1.0, 0.1
_LEAST_SHARE, _LEAST_LENGTH_M = 0.04, 0.06  # of the arm's mass, and from the joint: what every link is given


def mass_covariance(phi: Floats, spread: float, common: float, *, knows: bool = True) -> Floats:
    """Return the covariance (10 k, 10 k) of parameters (k, 10) by their relative errors s and c."""
    P = np.zeros((phi.size, phi.size))
    total = max(float(phi[:, 0].sum()), 1e-9)
    for i, p in enumerate(phi):
        mass, length = _FREE_MASS, _FREE_LENGTH_M
        if knows:
            mass = max(float(p[0]), _LEAST_SHARE * total)
            length = max(float(np.linalg.norm(p[1:4])) / max(float(p[0]), 1e-9), _LEAST_LENGTH_M)
        sizes = mass * np.array([MASS_SHARE, *[0.5 * length + 0.01] * 3, *[length**2 + 0.003] * 6])
        own = slice(PER_LINK * i, PER_LINK * (i + 1))
        P[own, own] = common**2 * np.outer(p, p) + np.diag((spread * sizes) ** 2)
    return P


def rows_of_file(parameters: Parameters) -> Iterator[tuple[Floats, float]]:
    """Yield [D | d] (r, k + 1) of each spread, D phi - d of deviations of one, and its log weight."""
    model = parameters.model
    unknown = {*model.missing_inertia, *(model.missing_tensor if parameters.terms == "full" else ())}
    places = [p for p, link in enumerate(parameters.links) if model.link_names[link] not in unknown]
    phi = link_parameters(model.tree).reshape(-1, PER_LINK)[[parameters.links[p] for p in places]]
    if not phi.any():
        return
    kept = [PER_LINK * i + p for i in range(len(phi)) for p in range(parameters.per_link)]
    columns = np.concatenate([np.r_[parameters.link_columns(p)] for p in places])
    for spread, common, share in (_EXACT, *SPREADS):
        rows = np.zeros((len(kept), len(parameters.names) + 1))
        L = np.linalg.cholesky(mass_covariance(phi, spread, common)[np.ix_(kept, kept)])
        rows[:, [*columns, -1]] = np.linalg.solve(L, np.column_stack([np.eye(len(kept)), phi.ravel()[kept]]))
        yield rows, float(np.log(share) - np.log(np.diag(L)).sum())
