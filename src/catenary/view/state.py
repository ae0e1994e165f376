"""The state that the view shows: one instant, as numbers and words."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats

MOST_WARNINGS = 6
LONGEST = 140  # characters of a warning


class ViewState(NamedTuple):
    """An arm at one instant; NaN for what is not known. Joints are the model's."""

    time: float  # [s] of the robot
    q: Floats  # (n,) [rad|m] reported
    calibrated: Floats  # (n,) [rad|m]
    interval: Floats  # (n,) half-width about `calibrated` [rad|m]
    inside: Floats  # (n,) 1 inside the model's valid range, 0 outside
    true: Floats  # (n,) [rad|m]
    setpoint: Floats  # (n,) [rad|m]
    tau: Floats  # (n,) [Nm|N] as commanded
    gravity_tau: Floats  # (n,) [Nm|N] what holds the arm still
    feedback: Floats  # (n,) [Nm|N] what the errors asked for: the PD term
    gravity: Floats  # (3,) [m/s2] as measured, in the base frame
    assumed: Floats  # (3,) [m/s2] as the controller takes it to be
    actual: Floats  # (3,) [m/s2] as it is, which a simulation knows
    gravity_age: float = np.inf  # [s]; infinite for gravity that is not measured
    rate: float = np.nan  # at which ticks come, as a share of what it should be
    late: float = 0.0  # ticks late within the last second
    mode: str = ""  # what the robot does, in words
    warnings: tuple[str, ...] = ()
    values: Mapping[str, float | bool | str] = {}  # of the page's controls, where the program has set them


_JOINTS = ("q", "calibrated", "interval", "inside", "true", "setpoint", "tau", "gravity_tau", "feedback")
_VECTORS = ("gravity", "assumed", "actual")


def unknown_state(n: int) -> ViewState:
    """Return the state of an arm of n joints of which nothing is known yet."""
    joints: dict[str, Any] = {name: np.full(n, np.nan) for name in _JOINTS}
    vectors: dict[str, Any] = {name: np.full(3, np.nan) for name in _VECTORS}
    return ViewState(time=0.0, **joints, **vectors)


def shortened(state: ViewState) -> ViewState:
    """Return a state whose words take little room, whatever a robot's or a file's names are."""
    warnings = tuple(_word(warning) for warning in state.warnings[:MOST_WARNINGS])
    return state._replace(mode=_word(state.mode), warnings=warnings)


def _word(text: str) -> str:
    """Return a text cut, and without what is none, as in a file's name."""
    return text[:LONGEST].encode(errors="replace").decode()
