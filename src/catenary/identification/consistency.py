"""Least squares over parameters that bodies can have: a semidefinite program.

A link's ten parameters are those of some distribution of mass if and only if its pseudo-inertia
J = [[1/2 tr(I) 1 - I, m c], [m c^T, m]] (4 x 4) is positive semidefinite (Wensing, Kim, Slotine, "Linear matrix
inequalities for physically consistent inertial parameter identification", RA-L 3(1), 2018). Friction, rotors and
springs cannot be negative. Both sets are convex; clarabel solves the program.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError, MissingPackageError
from catenary.identification.base_parameters import BaseParameters

LENGTH = 0.1  # [m] brings kg, kg m and kg m2 of arms to one size
LEAST = 1e-6  # [kg] least eigenvalue of J in these units: above zero, so that a link has a centre of mass
PREFER_SMALL = 1e-7  # of the squared torque per kg: what torques do not show is as little mass as may be


def consistent_fit(base: BaseParameters, R: Floats) -> Floats:
    """Return all parameters phi (k,) that minimise ||Y phi - tau|| among the physically consistent ones.

    Torques show combinations only; where they leave a choice, the smallest sum of pseudo-inertia traces is taken.

    Args:
        base: The base parameters.
        R: (b + 1, b + 1) triangle of the weighted [Y_b | tau].

    Raises:
        MissingPackageError: clarabel is not installed.
        InputError: Poses at rest, which show no inertia; or the solver found no solution.
    """
    try:
        import clarabel
    except ImportError as error:
        raise MissingPackageError(
            'a physically consistent fit needs clarabel: pip install "catenary[consistent]"'
        ) from error
    from scipy import sparse

    parameters = base.parameters
    if parameters.terms == "static":
        raise InputError("poses at rest show no inertia: a consistent fit needs full dynamics")
    b, k = base.combination.shape
    scale, count = _scale(base), len(parameters.links)
    size = float(np.linalg.norm(R[:, b]))
    fit = (R[: b + 1, :b] / size) @ (base.combination * scale)
    # variables: phi / scale, then the b + 1 residuals, so that no matrix is squared
    rows = b + 1
    A = [sparse.hstack([sparse.csc_matrix(fit), -sparse.identity(rows)])]
    right = [R[:, b] / size]
    cones: list[object] = [clarabel.ZeroConeT(rows)]
    signs = list(parameters.never_negative)
    if signs:
        A.append(
            sparse.csc_matrix((-np.ones(len(signs)), (range(len(signs)), signs)), (len(signs), k + rows))
        )
        right.append(np.zeros(len(signs)))
        cones.append(clarabel.NonnegativeConeT(len(signs)))
    trace = np.zeros(k + rows)
    body = _pseudo_inertia_map() @ np.diag(scale[:10])
    for place in range(count):
        block = np.zeros((10, k + rows))
        block[:, parameters.link_columns(place)] = -body
        A.append(sparse.csc_matrix(block))
        right.append(-LEAST * _triangle(np.eye(4)))
        cones.append(clarabel.PSDTriangleConeT(4))
        trace[parameters.link_columns(place)] = PREFER_SMALL * (_triangle(np.eye(4)) @ body)
    quadratic = sparse.csc_matrix(np.diag(np.concatenate([np.zeros(k), np.ones(rows)])))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solver = clarabel.DefaultSolver(
        quadratic, trace, sparse.csc_matrix(sparse.vstack(A)), np.concatenate(right), cones, settings
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise InputError(f"no physically consistent parameters found: the solver says {solution.status}")
    return np.array(solution.x[:k]) * scale


def pseudo_inertia(phi: Floats) -> Floats:
    """Return J (4, 4) of one link's parameters (10,) [kg, kg m, kg m2]."""
    mass, moment, six = phi[0], phi[1:4], phi[4:]
    tensor = np.zeros((3, 3))
    tensor[np.triu_indices(3)] = six
    tensor = tensor + np.triu(tensor, 1).T
    J = np.zeros((4, 4))
    J[:3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    J[:3, 3] = J[3, :3] = moment
    J[3, 3] = mass
    return J


def _scale(base: BaseParameters) -> Floats:
    """Bring the unknowns to one size: links by a length, actuation by one."""
    link = np.array([1.0, *[LENGTH] * 3, *[LENGTH**2] * 6])
    rest = base.combination.shape[1] - 10 * len(base.parameters.links)
    return np.concatenate([np.tile(link, len(base.parameters.links)), np.ones(rest)])


def _pseudo_inertia_map() -> Floats:
    """Return the matrix (10, 10) from a link's parameters to J's scaled upper triangle, lengths in units of LENGTH."""
    lengths = np.diag([1.0 / LENGTH] * 3 + [1.0])
    return np.column_stack([_triangle(lengths @ pseudo_inertia(e) @ lengths) for e in np.eye(10)])


def _triangle(J: Floats) -> Floats:
    """Return the upper triangle by columns, off-diagonal entries times sqrt 2: the solver's order and inner product."""
    return np.array([J[r, c] * (1.0 if r == c else np.sqrt(2.0)) for c in range(4) for r in range(c + 1)])
