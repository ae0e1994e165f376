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

The masses of a robot's file are wrong by unknown shares before a recording is looked at, c of all parts of a link
alike, s each by itself: P = c^2 phi phi^T + s^2 D, where D has the square of .3 of a link's size in each of its ten
parameters. s is .1, .3 or 1. An arm without masses has links of about 1 kg and .1 m.
"""

from collections.abc import Iterator
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters
from catenary.errors import InputError
from catenary.identification.base_parameters import FIRST_MOMENTS, BaseParameters, random_configurations, random_gravity
from catenary.robots.link_inertia import symmetric
from catenary.robots.model import Unseen

_LENGTH_M = 0.1  # [m] brings kg, kg m and kg m2 of arms to one size
_MIN_EIGENVALUE_KG = 1e-6  # [kg] least eigenvalue of J in these units: above zero, so that a link has a centre of mass
_SMALL_MASS_PENALTY = 1e-10  # of the squared torque per kg: what torques do not show is as little mass as may be
SPREADS = ((0.1, 0.1, 0.3), (0.3, 0.15, 0.5), (1.0, 0.3, 0.2))  # s, c, and how likely that is
_EXACT = (0.01, 0.2, 0.3)  # of a file whose masses are all wrong by one factor, if at all
MASS_SHARE = 0.3  # of a link's mass, that a spread of one is
_FREE_MASS, _FREE_LENGTH_M = 1.0, 0.1
_LEAST_SHARE, _LEAST_LENGTH_M = 0.04, 0.06  # of the arm's mass, and from the joint: what every link is given
_COM_REACH_M = 0.5  # [m] from a link's frame to its centre of mass, at most, where no inertia tells


def consistent_fit(base: BaseParameters, R: Floats, drawn: Floats | None = None) -> Floats:
    """Return all parameters phi (k,) that minimise ||Y phi - tau||, of R of [Y_b | tau], among the consistent ones.

    Rows [D | d] of a prior, if there are any, are minimised beside, in units of tau. Where torques leave a choice, the
    smallest sum of pseudo-inertia traces is taken.
    """
    b, k = base.combination.shape
    scale = parameter_scale(base)
    whole = np.column_stack([R[: b + 1, :b] @ base.combination, R[:, b]])
    whole = (whole if drawn is None else np.vstack([whole, drawn])) / np.linalg.norm(R[:, b])
    fit, right = whole[:, :k] * scale, whole[:, k]
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
    terms = base.combination.shape[1] - per_link * len(base.parameters.links)
    return np.concatenate([np.tile(link, len(base.parameters.links)), np.ones(terms)])


def _pseudo_inertia_map() -> Floats:
    """Return the matrix (10, 10) from a link's parameters to J's scaled upper triangle, lengths in _LENGTH_M."""
    lengths = np.diag([1.0 / _LENGTH_M] * 3 + [1.0])
    return np.column_stack([_triangle(lengths @ pseudo_inertia(e) @ lengths) for e in np.eye(10)])


def _triangle(J: Floats) -> Floats:
    """Return the upper triangle by columns, off-diagonal entries times sqrt 2: the solver's order and inner product."""
    return np.array([J[r, c] * (1.0 if r == c else np.sqrt(2.0)) for c in range(4) for r in range(c + 1)])


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


def _rows_of_file(base: BaseParameters) -> Iterator[tuple[Floats, float]]:
    """Yield [D | d] (r, k + 1) of each spread, D phi - d of deviations of one, and its log weight."""
    parameters, model = base.parameters, base.parameters.model
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


def likeliest_prior(base: BaseParameters, R: Floats, variance: float) -> Floats | None:
    """Return rows of the masses of the robot's file for `consistent_fit`, by the error with which R is likeliest.

    That is by the evidence of a Gaussian regression whose rows have a variance [MacKay, Bayesian interpolation, Neural
    Computation 4(3), 1992]. None if the file has no masses.
    """
    scale = np.append(parameter_scale(base), np.linalg.norm(R[:, -1]))
    fit = np.column_stack([R[:, :-1] @ base.combination, R[:, -1]]) / np.sqrt(variance)
    best, highest = None, -np.inf
    for rows, log_weight in _rows_of_file(base):
        sizes = np.abs(np.diag(np.linalg.qr(np.vstack([fit, rows]) * scale, mode="r"))) + 1e-300
        value = log_weight - 0.5 * float(sizes[-1] / scale[-1]) ** 2 - float(np.log(sizes[:-1]).sum())
        if value > highest:
            best, highest = rows * np.sqrt(variance), value
    return best


_MAX_MASS_RATIO = 2.0  # times the mass of all links as identified
_FELT_RATIO = 1e-6  # of the largest torque per unit: less is not felt
_FELT_ROWS = 60


def unseen_of(base: BaseParameters, phi: Floats) -> tuple[Unseen, ...]:
    """Return the parameter changes that the data leave open under another gravity, from beta and bodies' phi (k,)."""
    from scipy.linalg import qr

    parameters = base.parameters
    rng = np.random.default_rng(0)
    q = random_configurations(parameters.model, _FELT_ROWS, rng)
    still, gravity = np.zeros_like(q), random_gravity(_FELT_ROWS, rng)
    scale = parameter_scale(base)
    Y = parameters.regressor(q, still, still, gravity).reshape(-1, len(phi)) * scale
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
    """Return the range of scaled body parameters along a row from a point, at unchanged torques."""
    parameters, scale = base.parameters, parameter_scale(base)
    k = len(at)
    mass = np.zeros((1, k))
    mass[0, [parameters.link_columns(place).start for place in range(len(parameters.links))]] = 1.0
    C = base.combination * scale
    C = C / np.linalg.norm(C, axis=1, keepdims=True)
    bounded, limits, cones = consistent_cones(base)
    A, right = np.vstack([C, mass, bounded]), np.concatenate([C @ at, _MAX_MASS_RATIO * mass @ at, limits])
    cones = [clarabel.ZeroConeT(len(C)), clarabel.NonnegativeConeT(1), *cones]
    try:
        solution = solve_program(np.zeros((k, k)), -along, A, right, cones)
    except InputError:  # the point lies on the border of what is possible: no bound is known
        return np.inf
    return float(along @ (solution - at))
