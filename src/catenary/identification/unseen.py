"""What a level floor cannot show: changes of mass that torques feel under another gravity than the recordings'.

On a level base an upright first axis feels no gravity, and no torque tells the first moments about it. Dynamics bound
them all the same: bodies have |m c|^2 <= m I, and the inertia about the axis is known. So the least and the most are
found among physically consistent parameters that give the same torques, with links at most HEAVIEST times as heavy.
"""

import clarabel
import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.identification.base_parameters import BaseParameters, random_configurations
from catenary.identification.columns import FIRST_MOMENTS
from catenary.identification.consistency import consistent_cones, parameter_scale, solve_program
from catenary.robots.model import Unseen
from catenary.spatial import STANDARD_GRAVITY

HEAVIEST = 2.0  # times the mass of all links as identified
FELT = 1e-6  # of the largest torque per unit: less is not felt
ROWS = 60


def unseen_of(base: BaseParameters, phi: Floats) -> tuple[Unseen, ...]:
    """Return what the base parameters leave open that gravity from another direction would show.

    Args:
        base: Base parameters of recordings under one gravity.
        phi: (k,) parameters of bodies that were fitted.
    """
    parameters = base.parameters
    rng = np.random.default_rng(0)
    q = random_configurations(parameters.model, ROWS, rng)
    rest, directions = np.zeros_like(q), rng.normal(size=(ROWS, 3))
    gravity = STANDARD_GRAVITY * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    scale = parameter_scale(base)
    Y = parameters.regressor(q, rest, rest, gravity).reshape(-1, len(phi)) * scale
    links = len(parameters.links) * parameters.per_link
    Y[:, links:] = 0.0  # springs and constants are as they are on any base
    C = base.combination * scale
    _, values, Vt = np.linalg.svd(C)
    hidden = Vt[int((values > 1e-9 * values[0]).sum()) :].T
    felt = Y @ hidden
    _, sizes, directions_of = np.linalg.svd(felt, full_matrices=False)
    count = int((sizes > FELT * np.linalg.norm(Y, 2)).sum())
    if count == 0:
        return ()
    D = hidden @ directions_of[:count].T
    columns = _counted_in(D, parameters.per_link, links)
    D = D @ np.linalg.inv(D[columns])
    along = np.linalg.pinv(Y @ D) @ Y  # what any change of parameters has of each
    out = []
    for j, column in enumerate(columns):
        change = np.zeros((len(parameters.model.link_names), FIRST_MOMENTS))
        for place, link in enumerate(parameters.links):
            first = place * parameters.per_link
            change[link] = (D[:, j] * scale)[first : first + FIRST_MOMENTS] / scale[column]
        low, high = (_farthest(base, phi / scale, sign * along[j]) * sign for sign in (-1.0, 1.0))
        unit = float(scale[column])
        out.append(Unseen(parameters.names[column], change, min(0.0, low * unit), max(0.0, high * unit)))
    return tuple(out)


def _counted_in(D: Floats, per_link: int, links: int) -> list[int]:
    """Return as many first moments and masses as there are directions, which tell them apart best."""
    from scipy.linalg import qr

    eligible = [c for c in range(links) if c % per_link < FIRST_MOMENTS]
    nearest = np.linspace(1.0, 0.99, len(eligible))  # of equals, the link next to the base
    pivots = qr((D[eligible] * nearest[:, None]).T, mode="r", pivoting=True)[1][: D.shape[1]]
    return sorted(eligible[int(p)] for p in pivots)


def _farthest(base: BaseParameters, at: Floats, along: Floats) -> float:
    """Return how far scaled parameters of bodies can go from a point along a row, torques staying as they are."""
    parameters, scale = base.parameters, parameter_scale(base)
    k = len(at)
    mass = np.zeros((1, k))
    mass[0, [parameters.link_columns(place).start for place in range(len(parameters.links))]] = 1.0
    C = base.combination * scale
    C = C / np.linalg.norm(C, axis=1, keepdims=True)
    bounded, limits, cones = consistent_cones(base)
    try:
        found = solve_program(
            np.zeros((k, k)),
            -along,
            np.vstack([C, mass, bounded]),
            np.concatenate([C @ at, HEAVIEST * mass @ at, limits]),
            [clarabel.ZeroConeT(len(C)), clarabel.NonnegativeConeT(1), *cones],
        )
    except InputError:  # the point lies on the border of what is possible: nothing can be said
        return 0.0
    return float(along @ (found - at))
