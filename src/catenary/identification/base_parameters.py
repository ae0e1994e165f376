"""The parameters that torques can show at all: a smallest set of combinations of the links' and the actuation's.

Columns of the regressor are dependent for every motion, because most of a link's inertia moves like its
neighbours'. Over random motions an independent set of columns is found, and how the others are combined from them:
tau = Y_b beta, beta = phi_b + K phi_d. [Gautier, Khalil 1990, "Direct calculation of minimum set of inertial
parameters of serial robots"; Gautier 1991, "Numerical calculation of the base inertial parameters of robots",
J. Robotic Systems 8(4)] Whatever data are taken in the same gravity tell these combinations, and nothing else.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, spread
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.inverse_kinematics import search_range
from catenary.errors import InputError
from catenary.identification.parameters import FIRST_MOMENTS, Parameters
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL, STANDARD_GRAVITY

_CHUNK_ROWS = 4000  # rows whose regressor is held in memory at a time
_RANDOM_ROWS = 400
_DEPENDENT_RATIO = 1e-8  # of the largest column; random motion of exact geometry leaves eight decades around it
# angles that a file rounds (1.5708, 1.57) show 4e-6 to 9e-4 of a column beside exact ones, which no recording shows;
# the least own share of a column of the catalogue's robots is 0.02
_ROUNDED_RATIO = 2e-3
# of the largest column: more than a link's under gravity along an axis of 3.1416 for pi; others: 0.008
_SEEN_RATIO = 1e-5
_ROUNDING_RATIO = 1e-9  # of the largest entry of `combination`
# by 30 deg about a horizontal axis 40 deg from x: along nothing that a robot's axes are likely to lie along
TILTED = (
    float(STANDARD_GRAVITY * np.sin(np.deg2rad(30)) * np.sin(np.deg2rad(40))),
    float(-STANDARD_GRAVITY * np.sin(np.deg2rad(30)) * np.cos(np.deg2rad(40))),
    float(-STANDARD_GRAVITY * np.cos(np.deg2rad(30))),
)
Identifiability = Literal["alone", "combined", "none"]  # by itself; with others; not at all
Columns = NDArray[np.int64]


@dataclass(frozen=True)
class BaseParameters:
    """Which columns stay, and what each of them stands for: beta = combination @ phi."""

    parameters: Parameters
    columns: Columns  # (b,) of the whole regressor
    combination: Floats  # (b, k)
    condition: float = np.nan  # of Y_b over the motion they were found on, columns scaled; NaN from a file

    @property
    def count(self) -> int:
        """Number of identifiable parameters."""
        return len(self.columns)

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' own parameters; what else goes into each is `combination`."""
        return tuple(self.parameters.names[c] for c in self.columns)

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the columns' own parameters."""
        return tuple(self.parameters.units[c] for c in self.columns)

    @cached_property
    def identifiable(self) -> tuple[Identifiability, ...]:
        """Which of all parameters (k,) torques tell by themselves, in combination with others, or not at all."""
        return tuple(_identifiable(self.combination, c) for c in range(self.combination.shape[1]))

    def regressor(self, *motion: Floats) -> Floats:
        """Return the matrix (N, n, b) of tau = Y_b beta at motions (N, n); arguments as `Parameters.regressor`."""
        return self.parameters.regressor(*motion)[:, :, self.columns]

    def chunks(self, samples: Samples) -> Iterator[tuple[slice, Floats]]:
        """Yield parts of a recording's rows, and their matrix (N, n, b)."""
        parameters, loads = self.parameters, self.parameters.loads(samples)
        for first in range(0, max(len(samples), 1), _CHUNK_ROWS):
            part = slice(first, first + _CHUNK_ROWS)
            whole = samples.link_columns(parameters.model, part)
            yield part, parameters.beside_links(whole, loads[part])[:, :, self.columns]

    def named(self, direction: Floats) -> str:
        """Return the names of most of a direction (b,) of parameters."""
        most = np.argsort(-np.abs(direction))[:4]
        return ", ".join(self.names[i] for i in most if abs(direction[i]) > 0.1)

    def describe(self, index: int, names: Sequence[str] | None = None, digits: int = 5) -> str:
        """Return one base parameter as the sum that it is, by names (k,) of all: mx(elbow) + 0.4 m(hand)."""
        names = self.parameters.names if names is None else names
        text = names[int(self.columns[index])]
        for c in np.flatnonzero(self.combination[index]):
            if c != self.columns[index]:
                factor = self.combination[index, c]
                size = f"{abs(factor):.{digits}g}"
                text += f" {'+' if factor > 0.0 else '-'} {'' if size == '1' else f'{size} '}{names[int(c)]}"
        return text


def base_parameters(
    parameters: Parameters,
    gravity: Floats,
    recorded: tuple[Floats, Floats, Floats],
    rng: np.random.Generator,
    *,
    on_base: Floats | None = None,
) -> BaseParameters:
    """Find the base parameters on random and recorded motion together, the best conditioned columns first.

    Gravity is (3,) [m/s2] in base axes, `recorded` q, qd, qdd, (N, n) each. `on_base` (M, 3, 3) has gravity, angular
    velocity and acceleration of a base that moves, as recorded: random motion meets rows of it, and shows no more of
    the base than these do. At rest when None.
    """
    model = parameters.model
    size = (_RANDOM_ROWS, model.n)
    static = parameters.terms == "static"
    moves = (model.upper > model.lower) & (not static)  # base joints are held
    random = [
        random_configurations(model, _RANDOM_ROWS, rng),
        rng.normal(scale=2.0, size=size) * moves,
        rng.normal(scale=10.0, size=size) * moves,
    ]
    some = spread(len(recorded[0]), _RANDOM_ROWS)
    motion = [np.concatenate([a, b[some]]) for a, b in zip(random, recorded, strict=True)]
    rows = len(motion[0])
    down, turning = gravity, None
    if on_base is not None:
        down, omega, alpha = on_base[rng.integers(len(on_base), size=rows)].swapaxes(0, 1)
        turning = BaseMotion(omega, alpha)
    Y = parameters.regressor(motion[0], motion[1], motion[2], down, base=turning)
    return _reduced(parameters, Y.reshape(-1, len(parameters.names)), None)


def gravity_base_parameters(model: RobotModel, gravity: ArrayLike | None = LEVEL) -> BaseParameters:
    """Return the base parameters of gravity: the combinations of masses and first moments that torques depend on.

    Columns are taken in an order that puts each combination on the link next to the base: first moments from the
    base outwards, across the joint's axis before along it, masses last.

    Args:
        model: The robot; needs no inertia.
        gravity: Gravity in base axes (3,) [m/s2]; any direction when None.
    """
    parameters = Parameters(model, "static", actuated=False)
    rng = np.random.default_rng(0)
    q = random_configurations(model, max(40, 8 * len(model.tree.parent)), rng)
    if gravity is None:
        field = random_gravity(len(q), rng)
    else:
        field = as_array("gravity", gravity, (3,))
        if not np.linalg.norm(field) > 0.0:
            raise InputError("gravity is zero: expected an acceleration, without it no parameter has an effect")
    rest = np.zeros_like(q)
    Y = parameters.regressor(q, rest, rest, field).reshape(-1, len(parameters.names))
    return _reduced(parameters, Y, _outwards(parameters))


def random_configurations(model: RobotModel, count: int, rng: np.random.Generator) -> Floats:
    """Draw configurations (count, n) within the joint limits, or in `search_range` where there are none."""
    return rng.uniform(*search_range(model), size=(count, model.n))


def random_gravity(count: int, rng: np.random.Generator, size: float = STANDARD_GRAVITY) -> Floats:
    """Draw gravity (count, 3) of a size [m/s2] in directions that are equally likely."""
    directions = rng.normal(size=(count, 3))
    return np.asarray(size * directions / np.linalg.norm(directions, axis=1, keepdims=True))


def _reduced(parameters: Parameters, Y: Floats, order: Sequence[int] | None) -> BaseParameters:
    """Reduce a regressor over many rows (N, k) to independent columns, in an order of preference if there is one."""
    k = Y.shape[1]
    size = np.linalg.norm(Y, axis=0)
    own = np.array(parameters.own, dtype=np.int64)
    size[own] = 0.0
    least = np.full(k, _DEPENDENT_RATIO)
    if order is None:
        least[: len(parameters.links) * parameters.per_link] = _SEEN_RATIO
    seen = size > least * size.max(initial=0.0)
    unit = Y * (seen / np.where(seen, size, 1.0))
    chosen = _independent(unit, order) if seen.any() else np.array([], dtype=np.int64)
    # how the other columns are combined from the chosen ones: least squares is exact for dependent columns
    rest = np.setdiff1d(np.arange(k), chosen)
    combination = np.zeros((len(chosen), k))
    combination[np.arange(len(chosen)), chosen] = 1.0
    condition = 1.0
    if len(chosen):
        condition = float(np.linalg.cond(unit[:, chosen]))
        K = np.linalg.lstsq(unit[:, chosen], unit[:, rest], rcond=None)[0]
        combination[:, rest] = K * size[rest] / size[chosen][:, None]
        combination[np.abs(combination) < _ROUNDING_RATIO * np.abs(combination).max()] = 0.0
    if len(own):
        combination = np.vstack([combination, np.eye(k)[own]])
        order_of = np.argsort(np.concatenate([chosen, own]))
        chosen, combination = np.concatenate([chosen, own])[order_of], combination[order_of]
    return BaseParameters(parameters, chosen, combination, condition)


def _independent(unit: Floats, order: Sequence[int] | None) -> Columns:
    """Choose independent columns: by QR with pivoting, or in an order, each one that those before it do not give."""
    if order is None:
        from scipy.linalg import qr

        R, pivoted = qr(unit, mode="r", pivoting=True)
        pivots = np.abs(np.diag(R))
        return np.sort(pivoted[: int((pivots > _ROUNDED_RATIO * pivots[0]).sum())]).astype(np.int64)
    basis: list[Floats] = []
    chosen: list[int] = []
    for c in order:
        rest = unit[:, c]
        for b in basis * 2:  # twice: once leaves rounding of the order of the columns' dependence
            rest = rest - (b @ rest) * b
        left = float(np.linalg.norm(rest))
        if left > _DEPENDENT_RATIO:
            basis.append(rest / left)
            chosen.append(c)
    return np.array(chosen, dtype=np.int64)


def _outwards(parameters: Parameters) -> list[int]:
    """Return the columns of masses and first moments in the order of `gravity_base_parameters`."""
    across: list[int] = []
    along: list[int] = []
    masses: list[int] = []
    for place, link in enumerate(parameters.links):
        mass = FIRST_MOMENTS * place
        masses.append(mass)
        for axis, share in enumerate(np.abs(parameters.model.tree.axis[link])):
            (along if share > 0.999 else across).append(mass + 1 + axis)
    return across + along + masses


def _identifiable(combination: Floats, parameter: int) -> Identifiability:
    if not combination[:, parameter].any():
        return "none"
    # a row that is this parameter and no other
    alone = np.eye(combination.shape[1])[parameter]
    weights = np.linalg.lstsq(combination.T, alone, rcond=None)[0]
    return "alone" if float(np.abs(weights @ combination - alone).max()) < 1e-6 else "combined"
