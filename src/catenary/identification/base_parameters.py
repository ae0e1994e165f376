"""All parameters of a robot, links first, then actuation, and those that torques can show at all: a smallest set.

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
from catenary.dynamics.actuation_loads import term_load
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.inverse_kinematics import search_range
from catenary.dynamics.torque_regressor import PARAMETER_NAMES, PARAMETER_UNITS, PER_LINK, torque_regressor
from catenary.errors import InputError
from catenary.identification.identify_options import Terms
from catenary.identification.samples import HELD_OUT, Samples
from catenary.robots.actuation import ActuationTerm, actuation_terms
from catenary.robots.friction_terms import NOT_NEGATIVE
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL, STANDARD_GRAVITY

OF_RECORDING = " in "  # between the name of a friction and that of the recording that has it
FIRST_MOMENTS = 4  # of a link's ten parameters, mass and first moment: all that shows at rest
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
class Parameters:
    """The parameters of a robot that full dynamics, or poses at rest, can show."""

    model: RobotModel
    terms: Terms
    actuated: bool = True  # with the parameters of friction, rotors and springs

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Links that may have a mass, as indices into the tree."""
        return tuple(i for i, name in enumerate(self.model.link_names) if name not in self.model.massless)

    @cached_property
    def per_link(self) -> int:
        """Number of parameters per link, at most ten."""
        return FIRST_MOMENTS if self.terms == "static" else PER_LINK

    @cached_property
    def actuation(self) -> tuple[ActuationTerm, ...]:
        """The parameters beside those of the links."""
        if not self.actuated:
            return ()
        return actuation_terms(self.model.assumed_actuation, static=self.terms == "static")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the regressor's columns."""
        bodies = [f"{PARAMETER_NAMES[p]} {self.model.link_names[i]}" for i in self.links for p in range(self.per_link)]
        return (*bodies, *(f"{term.kind} {term.name}" for term in self.actuation))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units; those of effects on a combination are the combination's."""
        bodies = [PARAMETER_UNITS[p] for _ in self.links for p in range(self.per_link)]
        return (*bodies, *(self._unit(term) for term in self.actuation))

    def _unit(self, term: ActuationTerm) -> str:
        slides = self.model.joint_units[int(np.flatnonzero(term.combination)[0])] == "m"
        if term.kind == "spring" and term.lever is not None:
            return "N/m"
        if term.friction is not None:
            return term.friction.unit("m" if slides else "rad")
        return {"motor_inertia": ("kg m2", "kg"), "spring": ("Nm/rad", "N/m")}[term.kind][slides]

    @cached_property
    def own(self) -> tuple[int, ...]:
        """Columns of friction that no random motion finds dependent on others: they stand beside what is reduced."""
        return tuple(
            self._first + k
            for k, term in enumerate(self.actuation)
            if term.friction is not None and (term.recording or not term.friction.usual)
        )

    @cached_property
    def carrying(self) -> tuple[int, ...]:
        """Columns of what load-dependent friction grows with: links, rotors, springs."""
        frictionless = (k for k, term in enumerate(self.actuation) if term.friction is None)
        return (*range(self._first), *(self._first + k for k in frictionless))

    @cached_property
    def rotors(self) -> dict[int, ActuationTerm]:
        """The terms of rotors, by column."""
        return {self._first + k: term for k, term in enumerate(self.actuation) if term.kind == "motor_inertia"}

    @property
    def _first(self) -> int:
        return len(self.links) * self.per_link

    @cached_property
    def bounds(self) -> Floats:
        """Rows (r, k) of B phi >= 0: the bounds of friction terms, and no rotor or spring is below zero.

        What one recording has beside the others leaves its friction zero or more.
        """
        place = {(t.kind, t.name): self._first + k for k, t in enumerate(self.actuation)}
        alone, paired = list[dict[int, float]](), list[dict[int, float]]()
        for (kind, name), term in zip(place, self.actuation, strict=True):
            for factor, other in NOT_NEGATIVE if term.friction is None else term.friction.bounds:
                row = {place[kind, name]: factor}
                if other:
                    paired.append(row | _one(place.get((other, name))))
                else:
                    common = name.removesuffix(f"{OF_RECORDING}{term.recording}") if term.recording else ""
                    alone.append(row | _one(place.get((kind, common))))
        rows = [*alone, *paired]
        B = np.zeros((len(rows), len(self.names)))
        for r, row in enumerate(rows):
            for column, factor in row.items():
                B[r, column] = factor
        return B

    def link_columns(self, place: int) -> slice:
        """Return the columns of the link at a place in `links`."""
        return slice(place * self.per_link, (place + 1) * self.per_link)

    def regressor(
        self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, *, base: BaseMotion | None = None
    ) -> Floats:
        """Return the matrix (N, n, k) of tau = Y phi at motions (N, n), gravity (3,) or (N, 3) [m/s2] in base axes.

        Friction is as in steady sliding, without load.
        """
        whole = torque_regressor(self.model, q, qd, qdd, gravity, base)
        smoothing = self.model.assumed_actuation.coulomb_velocity
        each = (term_load(term, q, qd, qdd, smoothing) for term in self.actuation)
        return self.beside_links(whole, np.column_stack([np.zeros((len(q), 0)), *each]))

    def beside_links(self, whole: Floats, loads: Floats) -> Floats:
        """Return the matrix (N, n, k) of all links' columns (N, n, 10 L) and the loads (N, t) of the actuation."""
        own = [PER_LINK * i + p for i in self.links for p in range(self.per_link)]
        along = np.array([term.combination for term in self.actuation]).reshape(-1, whole.shape[1])
        columns = loads[:, None, :] * along.T[None]
        return np.concatenate([whole[:, :, own], columns], axis=2)

    def loads(self, samples: Samples) -> Floats:
        """Return the loads (N, t) of the actuation's terms on a recording's rows, as friction remembers its history."""
        smoothing = self.model.assumed_actuation.coulomb_velocity
        each = (recorded_load(term, samples, smoothing) for term in self.actuation)
        return np.column_stack([np.zeros((len(samples), 0)), *each])


def recorded_load(term: ActuationTerm, samples: Samples, coulomb_velocity: float) -> Floats:
    """Return the load (N,) of a term on a recording's rows, per unit, as friction remembers the motion."""
    if term.recording and samples.name.removesuffix(HELD_OUT) != term.recording:
        return np.zeros(len(samples))
    friction = term.friction
    if samples.history is None or friction is None or not (friction.leaps or friction.memory):
        return term_load(term, samples.q, samples.qd, samples.qdd, coulomb_velocity, samples.carried)
    c = term.combination
    load = samples.history.load(friction, c, term.scale, coulomb_velocity)
    if friction.grows_with_load:
        carried = np.zeros(len(samples)) if samples.carried is None else samples.carried @ c
        load = load * np.abs(carried) / (c @ c)
    return load


def _one(column: int | None) -> dict[int, float]:
    return {} if column is None else {column: 1.0}


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
        largest = np.argsort(-np.abs(direction))[:4]
        return ", ".join(self.names[i] for i in largest if abs(direction[i]) > 0.1)

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
    still = np.zeros_like(q)
    Y = parameters.regressor(q, still, still, field).reshape(-1, len(parameters.names))
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
    dependent = np.setdiff1d(np.arange(k), chosen)
    combination = np.zeros((len(chosen), k))
    combination[np.arange(len(chosen)), chosen] = 1.0
    condition = 1.0
    if len(chosen):
        condition = float(np.linalg.cond(unit[:, chosen]))
        K = np.linalg.lstsq(unit[:, chosen], unit[:, dependent], rcond=None)[0]
        combination[:, dependent] = K * size[dependent] / size[chosen][:, None]
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
        remainder = unit[:, c]
        for b in basis * 2:  # twice: once leaves rounding of the order of the columns' dependence
            remainder = remainder - (b @ remainder) * b
        left = float(np.linalg.norm(remainder))
        if left > _DEPENDENT_RATIO:
            basis.append(remainder / left)
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
