"""Parameters that bodies can have: least squares over them, drawn to a robot file's masses, and what it leaves open.

A link's ten parameters are those of some distribution of mass if and only if its pseudo-inertia
J = [[1/2 tr(I) 1 - I, m c], [m c^T, m]] (4 x 4) is positive semidefinite (Wensing, Kim, Slotine, "Linear matrix
inequalities for physically consistent inertial parameter identification", RA-L 3(1), 2018). Friction, rotors and
springs cannot be negative. At rest only mass and first moment show: the centre of mass lies within _COM_REACH_M of the
frame. All these sets are convex; clarabel solves the program.

On a level base an upright first axis feels no gravity, and no torque tells the first moments about it. Dynamics bound
them all the same: bodies have |m c|^2 <= m I, and the inertia about the axis is known. So the least and the most are
found among physically consistent parameters that give the same torques, with links at most _MAX_MASS_RATIO times as
heavy.
"""

from collections.abc import Sequence
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters
from catenary.errors import InputError
from catenary.identification.base_parameters import BaseParameters, random_configurations, random_gravity
from catenary.identification.least_squares import joined, triangles
from catenary.identification.parameters import FIRST_MOMENTS, Parameters
from catenary.identification.samples import FOLDS, Samples, fold_of_rows
from catenary.robots.link_inertia import symmetric
from catenary.robots.model import Unseen

_LENGTH_M = 0.1  # [m] brings kg, kg m and kg m2 of arms to one size
_MIN_EIGENVALUE_KG = 1e-6  # [kg] least eigenvalue of J in these units: above zero, so that a link has a centre of mass
_SMALL_MASS_PENALTY = 1e-10  # of the squared torque per kg: what torques do not show is as little mass as may be
MIN_PRIOR_WEIGHT = 1e-8  # of the squared torque: with a prior, what torques do not show is the prior's
_COM_REACH_M = 0.5  # [m] from a link's frame to its centre of mass, at most, where no inertia tells


def consistent_fit(
    base: BaseParameters, R: Floats, prior: Floats | None = None, weight: float = MIN_PRIOR_WEIGHT
) -> Floats:
    """Return all parameters phi (k,) that minimise ||Y phi - tau||, of R of [Y_b | tau], among the consistent ones.

    Where torques leave a choice, the smallest sum of pseudo-inertia traces is taken. With a prior J0 of the links (k,),
    weight sum ||L^-1 (J - J0) L^-T||^2, J0 = L L^T, is added, in units of the squared torque, which depends on no units
    and frames (Lee, Wensing, Park, IEEE Trans. Robotics 36(2), 2020); of links without mass in it nothing is expected.
    """
    b, k = base.combination.shape
    scale = parameter_scale(base)
    size = float(np.linalg.norm(R[:, b]))
    fit = (R[: b + 1, :b] / size) @ (base.combination * scale)
    right = R[:, b] / size
    if prior is not None:
        drawn, towards = _prior_rows(base, prior, scale)
        fit = np.vstack([fit, np.sqrt(weight) * drawn])
        right = np.concatenate([right, np.sqrt(weight) * towards])
    # variables: phi / scale, then the residuals, so that no matrix is squared
    rows = len(right)
    A = [sparse.hstack([sparse.csc_matrix(fit), -sparse.identity(rows)])]
    cones: list[object] = [clarabel.ZeroConeT(rows)]
    bounded, limits, sets = consistent_cones(base)
    A.append(sparse.hstack([sparse.csc_matrix(bounded), sparse.csc_matrix((len(limits), rows))]))
    linear = np.zeros(k + rows)
    per_link, links = base.parameters.per_link, len(base.parameters.links)
    trace = _triangle(np.eye(4)) @ _pseudo_inertia_map() * scale[:PER_LINK] if per_link == PER_LINK else np.eye(4)[0]
    linear[: links * per_link] = _SMALL_MASS_PENALTY * np.tile(trace, links)
    quadratic = sparse.csc_matrix(np.diag(np.concatenate([np.zeros(k), np.ones(rows)])))
    phi = solve_program(quadratic, linear, sparse.vstack(A), np.concatenate([right, limits]), [*cones, *sets])
    return phi[:k] * scale


def consistent_cones(base: BaseParameters) -> tuple[Floats, Floats, list[object]]:
    """Return A, b and cones of b - A phi / scale in cones: what parameters of bodies and friction keep."""
    parameters, scale = base.parameters, parameter_scale(base)
    k = base.combination.shape[1]
    A, right, cones = [-parameters.bounds * scale], [np.zeros(len(parameters.bounds))], list[object]()
    if len(parameters.bounds):
        cones.append(clarabel.NonnegativeConeT(len(parameters.bounds)))
    body = _pseudo_inertia_map() @ np.diag(scale[:10]) if parameters.per_link == PER_LINK else None
    for place in range(len(parameters.links)):
        columns = parameters.link_columns(place)
        if body is not None:
            block = np.zeros((10, k))
            block[:, columns] = -body
            right.append(-_MIN_EIGENVALUE_KG * _triangle(np.eye(4)))
            cones.append(clarabel.PSDTriangleConeT(4))
        else:
            block = np.zeros((4, k))
            block[:, columns] = -np.diag([_COM_REACH_M, 1.0, 1.0, 1.0]) * scale[columns]
            right.append(np.array([-_MIN_EIGENVALUE_KG * _COM_REACH_M, 0.0, 0.0, 0.0]))
            cones.append(clarabel.SecondOrderConeT(4))
        A.append(block)
    return np.vstack(A), np.concatenate(right), cones


def solve_program(quadratic: Any, linear: Floats, A: Any, right: Floats, cones: list[object]) -> Floats:
    """Minimise 1/2 x' P x + q' x with b - A x in cones."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    program = sparse.csc_matrix(quadratic), linear, sparse.csc_matrix(A), right, cones
    solution = clarabel.DefaultSolver(*program, settings).solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise InputError(
            f"no physically consistent parameters found: the solver says {solution.status}; --free fits without"
        )
    return np.array(solution.x)


def _prior_rows(base: BaseParameters, prior: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """Return rows D and values d of ||D phi / scale - d||^2, the distance of links from their prior."""
    parameters = base.parameters
    rows, values = [], []
    for place in range(len(parameters.links)):
        columns = parameters.link_columns(place)
        own = prior[columns]
        if not own[0] > 0.0:
            continue
        if parameters.per_link == PER_LINK:
            J0 = pseudo_inertia(own)
            J0 = J0 + 1e-3 * np.trace(J0[:3, :3]) * np.diag([1.0, 1.0, 1.0, 0.0])  # a point's has no inverse
            inverse = np.linalg.inv(np.linalg.cholesky(J0))
            block = np.column_stack([_triangle(inverse @ pseudo_inertia(e) @ inverse.T) for e in np.eye(10)])
        else:  # a ball about the centre of mass that is expected
            centre = own[1:] / own[0]
            block = np.zeros((4, 4))
            block[0, 0] = 1.0 / own[0]
            block[1:, 0] = -centre / (own[0] * _LENGTH_M)
            block[1:, 1:] = np.eye(3) / (own[0] * _LENGTH_M)
        wide = np.zeros((len(block), len(scale)))
        wide[:, columns] = block * scale[columns]
        rows.append(wide)
        values.append(block @ own)
    if not rows:
        return np.zeros((0, len(scale))), np.zeros(0)
    return np.vstack(rows), np.concatenate(values)


def pseudo_inertia(phi: Floats) -> Floats:
    """Return J (4, 4) of one link's parameters (10,) [kg, kg m, kg m2]."""
    mass, moment, six = phi[0], phi[1:4], phi[4:]
    tensor = symmetric(six)
    J = np.zeros((4, 4))
    J[:3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    J[:3, 3] = J[3, :3] = moment
    J[3, 3] = mass
    return J


def parameter_scale(base: BaseParameters) -> Floats:
    """Bring the unknowns to one size: links by a length, actuation by one."""
    per_link = base.parameters.per_link
    link = np.array([1.0, *[_LENGTH_M] * 3, *[_LENGTH_M**2] * 6])[:per_link]
    rest = base.combination.shape[1] - per_link * len(base.parameters.links)
    return np.concatenate([np.tile(link, len(base.parameters.links)), np.ones(rest)])


def _pseudo_inertia_map() -> Floats:
    """Return the matrix (10, 10) from a link's parameters to J's scaled upper triangle, lengths in _LENGTH_M."""
    lengths = np.diag([1.0 / _LENGTH_M] * 3 + [1.0])
    return np.column_stack([_triangle(lengths @ pseudo_inertia(e) @ lengths) for e in np.eye(10)])


def _triangle(J: Floats) -> Floats:
    """Return the upper triangle by columns, off-diagonal entries times sqrt 2: the solver's order and inner product."""
    return np.array([J[r, c] * (1.0 if r == c else np.sqrt(2.0)) for c in range(4) for r in range(c + 1)])


_PRIOR_WEIGHTS = (MIN_PRIOR_WEIGHT, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)  # that held-out blocks choose among
_MIN_LOG_GAIN = 0.02  # least that a stronger prior takes from the sum over axes of log squares: 1 % of one axis


def prior_of(parameters: Parameters) -> Floats | None:
    """Return the parameters (k,) that the robot's file gives its links, zero where it gives none; None if nowhere."""
    model = parameters.model
    unknown = {*model.missing_inertia, *(model.missing_tensor if parameters.terms == "full" else ())}
    own = link_parameters(model.tree).reshape(-1, PER_LINK)
    prior = np.zeros(len(parameters.names))
    for place, link in enumerate(parameters.links):
        if model.link_names[link] not in unknown:
            prior[parameters.link_columns(place)] = own[link, : parameters.per_link]
    return prior if prior.any() else None


def weight_of_prior(base: BaseParameters, samples: Sequence[Samples], weights: Floats, prior: Floats) -> float:
    """Return the weight of a prior with which blocks that were not fitted are predicted best."""
    folds = [[part.rows(fold_of_rows(part) == f, part.name) for part in samples] for f in range(FOLDS)]
    used = [[part for part in fold if len(part)] for fold in folds]  # one may lack a recording that is too short
    reduced = [triangles(base, fold) for fold in used if fold]
    if len(reduced) < 2:
        return MIN_PRIOR_WEIGHT
    best, least = MIN_PRIOR_WEIGHT, np.inf
    for weight in _PRIOR_WEIGHTS:
        squares = np.zeros(len(weights))
        for f, held_out in enumerate(reduced):
            R = joined([part for k, part in enumerate(reduced) if k != f]).stacked(weights)
            beta = base.combination @ consistent_fit(base, R, prior, weight)
            squares += held_out.residual_rms(beta) ** 2 * held_out.rows
        score = float(np.log(np.maximum(squares, 1e-300)).sum())
        if score < least - _MIN_LOG_GAIN:
            best, least = weight, score
    return best


_MAX_MASS_RATIO = 2.0  # times the mass of all links as identified
_FELT_RATIO = 1e-6  # of the largest torque per unit: less is not felt
_FELT_ROWS = 60


def unseen_of(base: BaseParameters, phi: Floats) -> tuple[Unseen, ...]:
    """Return what base parameters, and bodies' phi (k,) as fitted, leave open under gravity from elsewhere."""
    from scipy.linalg import qr

    parameters = base.parameters
    rng = np.random.default_rng(0)
    q = random_configurations(parameters.model, _FELT_ROWS, rng)
    rest, gravity = np.zeros_like(q), random_gravity(_FELT_ROWS, rng)
    scale = parameter_scale(base)
    Y = parameters.regressor(q, rest, rest, gravity).reshape(-1, len(phi)) * scale
    links = len(parameters.links) * parameters.per_link
    Y[:, links:] = 0.0  # springs and constants are as they are on any base
    C = base.combination * scale
    _, values, Vt = np.linalg.svd(C)
    hidden = Vt[int((values > 1e-9 * values[0]).sum()) :].T
    felt = Y @ hidden
    _, sizes, directions_of = np.linalg.svd(felt, full_matrices=False)
    count = int((sizes > _FELT_RATIO * np.linalg.norm(Y, 2)).sum())
    if count == 0:
        return ()
    D = hidden @ directions_of[:count].T
    # as many first moments and masses as there are directions, which tell them apart best; of equals, the link that is
    # next to the base
    eligible = [c for c in range(links) if c % parameters.per_link < FIRST_MOMENTS]
    nearest = np.linspace(1.0, 0.99, len(eligible))
    pivots = qr((D[eligible] * nearest[:, None]).T, mode="r", pivoting=True)[1][: D.shape[1]]
    columns = sorted(eligible[int(p)] for p in pivots)
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
            np.concatenate([C @ at, _MAX_MASS_RATIO * mass @ at, limits]),
            [clarabel.ZeroConeT(len(C)), clarabel.NonnegativeConeT(1), *cones],
        )
    except InputError:  # the point lies on the border of what is possible: no bound is known
        return np.inf
    return float(along @ (found - at))
