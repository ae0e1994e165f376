"""Friction states of coupled joints as features: how far dry friction and springs make joints lag, row by row."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, Integers
from catenary.config import IN_FILES
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.transmission.cable_friction import CoupledFriction, drag_state, lag_of

Row = Annotated[tuple[Annotated[float, Field(ge=-1e100, le=1e100)], ...], Field(max_length=100)]
Matrix = Annotated[tuple[Row, ...], Field(max_length=100)]


@dataclass(frozen=True)
class FrictionStates:
    """Numbers of `CoupledFriction`, computed once, that n positions move: a loop must find the evaluated bits."""

    __pydantic_config__ = IN_FILES

    positions: Annotated[tuple[str, ...], Field(max_length=100)]  # (n,) "q:<joint>"
    longest: Row
    directions: Matrix
    mutual: Matrix
    hold: Matrix
    lever: Matrix
    thresholds: Matrix

    def __post_init__(self) -> None:
        n, m, systems = len(self.positions), len(self.directions), len(self.thresholds)
        shapes = {"longest": (n,), "directions": (m, n), "mutual": (m, m), "hold": (m, n), "lever": (n, m)}
        actual = {name: np.shape(getattr(self, name)) for name in shapes}
        fits = actual == shapes and np.shape(self.thresholds) == (systems, m) and min(n, m, systems) > 0
        if not fits or len(set(self.positions)) != n or not min(self.longest) > 0.0:
            raise InputError(f"friction states of {', '.join(self.positions)}: matrices do not fit together, {actual}")
        if not all(self.mutual[k][k] > 0.0 for k in range(m)) or min(map(min, self.thresholds)) < 0.0:
            raise InputError("friction states: expected compliances above zero and thresholds of zero or more")

    @staticmethod
    def of(positions: tuple[str, ...], friction: CoupledFriction) -> "FrictionStates":
        """Return the friction states of positions."""
        longest, *matrices = (array.tolist() for array in friction)
        return FrictionStates(positions, tuple(longest), *(tuple(map(tuple, matrix)) for matrix in matrices))

    @property
    def constants(self) -> CoupledFriction:
        """Springs and friction as arrays."""
        return CoupledFriction(*(np.array(getattr(self, name)) for name in CoupledFriction._fields))

    @property
    def columns(self) -> list[tuple[str, str]]:
        """Name of each feature, and the position whose lag it is."""
        systems = range(1, len(self.thresholds) + 1)
        return [(f"friction({position}, {c})", position) for c in systems for position in self.positions]

    @property
    def size(self) -> int:
        """Size of a state: the previous positions, and the forces of every system."""
        return len(self.positions) + len(self.thresholds) * len(self.directions)


@dataclass(frozen=True)
class FoundFriction:
    """Properties of joints that friction couples, found in recordings."""

    states: FrictionStates
    gain: float  # share of the coupled joints' error on blocks of time that friction states take from play states'


@compiled
def rub(
    signals: Floats,  # (N, S) what the robot reports, row after row
    places: Integers,  # (n,) which signals the positions are
    owners: Integers,  # (n,) which columns of `away` these have
    away: Flags,  # (N, J) see `find_leaps`
    at: Integers,  # (1,) first column to write
    longest: Floats,  # (n,); this and the following are those of CoupledFriction
    directions: Floats,  # (m, n)
    mutual: Floats,  # (m, m)
    hold: Floats,  # (m, n)
    lever: Floats,  # (n, m)
    thresholds: Floats,  # (C, m)
    position: Floats,  # (n,) working memory; also the two that follow
    moved: Floats,  # (n,)
    slip: Floats,  # (m,)
    friction: Floats,  # (2, n + C m) states: remembered, and of the last row; NaN before the first
    X: Floats,  # (N, F) receives lags, system by system
) -> None:
    """Write friction states of rows of one motion, leaps as for play states, and remember what later rows take."""
    n, m = len(places), len(slip)
    for row in range(len(signals)):
        finite, leapt = True, False
        for j in range(n):
            position[j] = signals[row, places[j]]
            finite, leapt = finite and np.isfinite(position[j]), leapt or away[row, owners[j]]
        if finite:
            friction[1] = friction[0]
            drag_state(position, longest, directions, mutual, hold, thresholds, friction[1], moved, slip)
            if not leapt:
                friction[0] = friction[1]
        for c in range(len(thresholds)):
            forces = friction[1, n + c * m : n + (c + 1) * m]
            for j in range(n):
                X[row, at[0] + c * n + j] = lag_of(j, lever, forces) if finite else np.nan
