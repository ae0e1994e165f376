"""Which masses and first moments gravity torques can tell, and in which combinations.

Gautier, Khalil 1990, "Direct calculation of minimum set of inertial parameters of serial robots", and Gautier 1991,
"Numerical calculation of the base inertial parameters of robots": the standard regressor over random configurations
has dependent columns; an independent set of them, each with the dependent ones regrouped onto it, is the minimal
(base) set. Whatever data are taken in the same gravity tell these combinations, and nothing else.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError
from catenary.gravity.regressor import (
    standard_gravity_parameters,
    standard_gravity_regressor,
    standard_labels,
)
from catenary.robots.model import RobotModel
from catenary.sensing.vector import LEVEL, STANDARD_GRAVITY

# by 30 deg about a horizontal axis 40 deg from x: along nothing that a robot's axes are likely to lie along
TILTED = (
    float(STANDARD_GRAVITY * np.sin(np.deg2rad(30)) * np.sin(np.deg2rad(40))),
    float(-STANDARD_GRAVITY * np.sin(np.deg2rad(30)) * np.cos(np.deg2rad(40))),
    float(-STANDARD_GRAVITY * np.cos(np.deg2rad(30))),
)
DEPENDENT = 1e-8  # what is left of a unit column that the others give
# by itself; in combination with others; not at all; known, as the link is declared massless
Identifiability = Literal["alone", "combined", "none", "known"]


@dataclass(frozen=True)
class BaseParameters:
    """A minimal set of combinations of the standard parameters (m, m c) that gives every gravity torque."""

    model: RobotModel
    combination: Floats  # (rank, 4 n_links): base parameters = combination @ standard parameters
    columns: tuple[int, ...]  # (rank,) the standard parameter that each combination is led by
    condition: float  # largest by smallest singular value of the base regressor, columns scaled to one length
    identifiable: tuple[Identifiability, ...]  # of each standard parameter

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.columns)

    @property
    def labels(self) -> tuple[str, ...]:
        """Base parameters in the standard ones: mx(elbow) + 0.4 m(hand)."""
        names = standard_labels(self.model)
        return tuple(
            _combination_text(row, names, lead)
            for row, lead in zip(self.combination, self.columns, strict=True)
        )

    def values(self, model: RobotModel | None = None) -> Floats:
        """Base parameters (rank,) [kg m or kg] of a robot of this structure.

        Raises:
            MissingInertiaError: Links without inertia.
        """
        values: Floats = (
            self.combination @ standard_gravity_parameters(self.model if model is None else model).values
        )
        return values

    def regressor(self, q: ArrayLike, gravity: ArrayLike) -> Floats:
        """Columns (n, rank) or (N, n, rank) of the standard regressor that belong to the base parameters."""
        Z: Floats = standard_gravity_regressor(self.model, q, gravity)[..., list(self.columns)]
        return Z


def base_parameters(
    model: RobotModel,
    gravity: ArrayLike | None = LEVEL,
    *,
    rng: np.random.Generator | None = None,
) -> BaseParameters:
    """Minimal set of gravity parameters, for gravity that stays as it is, or that turns.

    Links declared massless have no parameters: theirs are known to be zero.

    Columns are taken in an order that puts each combination on the link next to the base: first moments from the
    base outwards, across the joint's axis before along it, masses last. One that those taken before it do not give
    is a base parameter. (Gram-Schmidt, each column orthogonalised twice, on more rows than columns)

    Args:
        model: The robot; it needs no inertia. Configurations are drawn from its joint limits, which the condition
            number depends on.
        gravity: (3,) free-fall acceleration that all data are taken in [m/s2]; None for directions that vary.
        rng: Of the configurations; a fixed seed when None.

    Raises:
        InputError: Gravity has another shape, is not finite or zero.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    count = max(40, 8 * len(model.tree.parent))
    q = random_configurations(model, count, rng)
    if gravity is None:
        directions = rng.normal(size=(count, 3))
        field = STANDARD_GRAVITY * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    else:
        field = as_array("gravity", gravity, (3,))
        if not np.linalg.norm(field) > 0.0:
            raise InputError(
                "gravity is zero: expected an acceleration, without it no parameter has an effect"
            )
    W = standard_gravity_regressor(model, q, field).reshape(-1, 4 * len(model.tree.parent))
    lengths = np.linalg.norm(W, axis=0)
    known = np.repeat([link in model.massless for link in model.link_names], 4)
    effect = (lengths > DEPENDENT * lengths.max(initial=0.0)) & ~known
    unit = W / np.where(effect, lengths, 1.0)
    basis: list[Floats] = []
    columns: list[int] = []
    for c in _order(model):
        if not effect[c]:
            continue
        rest = unit[:, c]
        for _ in range(2):
            for b in basis:
                rest = rest - (b @ rest) * b
        left = float(np.linalg.norm(rest))
        if left > DEPENDENT:
            basis.append(rest / left)
            columns.append(c)
    combination = np.zeros((len(columns), W.shape[1]))
    condition = 1.0
    if columns:
        combination = np.linalg.lstsq(W[:, columns], W * effect, rcond=None)[0]
        largest = np.abs(combination).max()
        combination[np.abs(combination) < 1e-7 * largest] = 0.0
        condition = float(np.linalg.cond(unit[:, columns]))
    return BaseParameters(
        model=model,
        combination=frozen(combination),
        columns=tuple(columns),
        condition=condition,
        identifiable=tuple("known" if known[c] else _identifiable(combination, c) for c in range(W.shape[1])),
    )


def random_configurations(model: RobotModel, count: int, rng: np.random.Generator) -> Floats:
    """Draw configurations (count, n) within the joint limits, [-pi, pi] rad or [-1, 1] m where there are none."""
    free = np.where(np.array(model.joint_units) == "rad", np.pi, 1.0)
    lower = np.where(np.isfinite(model.lower), model.lower, -free)
    upper = np.where(np.isfinite(model.upper), model.upper, free)
    return rng.uniform(lower, upper, size=(count, model.n))


def _order(model: RobotModel) -> list[int]:
    first, along = [], []
    for link in range(len(model.tree.parent)):
        axis = np.abs(model.tree.axis[link])
        moments = sorted(range(3), key=lambda a: axis[a] > 0.999)
        first += [4 * link + 1 + a for a in moments if axis[a] <= 0.999]
        along += [4 * link + 1 + a for a in moments if axis[a] > 0.999]
    return first + along + [4 * link for link in range(len(model.tree.parent))]


def _identifiable(combination: Floats, parameter: int) -> Identifiability:
    """Say whether a parameter alone is in the span of the combinations."""
    column = combination[:, parameter]
    if not column.any():
        return "none"
    # a row that is this parameter and no other
    weights = np.linalg.lstsq(combination.T, np.eye(combination.shape[1])[parameter], rcond=None)[0]
    rest = weights @ combination - np.eye(combination.shape[1])[parameter]
    return "alone" if float(np.abs(rest).max()) < 1e-6 else "combined"


def _combination_text(row: Floats, names: tuple[str, ...], lead: int) -> str:
    text = names[lead]
    for c in np.flatnonzero(row):
        if c == lead:
            continue
        size = f"{abs(row[c]):.4g}"
        text += f" {'-' if row[c] < 0.0 else '+'} {'' if size == '1' else size + ' '}{names[c]}"
    return text
