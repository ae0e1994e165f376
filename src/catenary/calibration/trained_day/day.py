"""What a day of training looked like to somebody without encoders: what a watch in the loop compares with."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.calibration.features import FeatureSet
from catenary.calibration.predictors import Quadratic
from catenary.calibration.valid_range import ValidRange
from catenary.errors import InputError


@dataclass(frozen=True)
class UsualBounds:
    """Between which a quantity of each joint lies as long as nothing has changed.

    Raises:
        InputError: Arrays of other shapes, or a lower bound above the upper one.
    """

    lower: Floats  # (n,)
    upper: Floats  # (n,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lower", as_array("lower bounds", self.lower, (None,)))
        object.__setattr__(self, "upper", as_array("upper bounds", self.upper, self.lower.shape))
        if not (self.lower <= self.upper).all():
            raise InputError(f"bounds: {self.lower.tolist()} above {self.upper.tolist()}")

    def beyond(self, values: Floats) -> Floats:
        """Return how far values (n,) lie above the upper bounds (positive) or below the lower ones (negative)."""
        return np.maximum(values - self.upper, 0.0) + np.minimum(values - self.lower, 0.0)


@dataclass(frozen=True)
class TrainedTorque:
    """Torques of a model's joints by their positions, and by the side on which their cables lie."""

    features: FeatureSet  # the positions, and a play state of each joint that moved
    predictor: Quadratic
    valid_range: ValidRange  # of the positions
    usual: UsualBounds  # of a window's mean of torque less prediction [Nm|N]

    def __post_init__(self) -> None:
        n, F = len(self.features.signals), len(self.features.names)
        if self.predictor.shape != (F, n) or len(self.valid_range.lower) != n or len(self.usual.lower) != n:
            raise InputError(
                f"watch: torques of {n} joints by {F} features; got a predictor of {self.predictor.shape}, a range of "
                f"{len(self.valid_range.lower)} and bounds of {len(self.usual.lower)}"
            )
        if self.features.positions != self.features.signals or set(self.features.played) - set(
            self.features.signals
        ):
            raise InputError("watch: torques are told by positions alone")


@dataclass(frozen=True)
class TrainedDay:
    """The training recordings' torques, share of rows outside the valid range, and registrations; None: not known.

    Raises:
        InputError: A window that is not positive.
    """

    window: float  # [s] over which torques and flags are averaged before they are compared
    reach: Floats  # (n,) how far each joint moved [rad|m]
    torque: TrainedTorque | None
    outside: Floats | None  # (n,) largest usual share of a window outside the valid range
    homing: (
        UsualBounds | None
    )  # registration of each joint [rad|m], and as far beyond as the model's intervals reach
    not_watched: tuple[str, ...]  # in words: what is not known, and why

    def __post_init__(self) -> None:
        if not 0.0 < self.window < np.inf:
            raise InputError(f"watch: expected a window of more than 0 s, got {self.window}")
        object.__setattr__(self, "reach", as_array("reach", self.reach, (None,)))
        if self.outside is not None:
            object.__setattr__(self, "outside", as_array("outside", self.outside, self.reach.shape))
        n = len(self.reach)
        if self.torque is not None and len(self.torque.features.signals) != n:
            raise InputError(
                f"watch: expected torques of {n} joints, got {len(self.torque.features.signals)}"
            )
        for bounds in (self.homing, None if self.torque is None else self.torque.usual):
            if bounds is not None and len(bounds.lower) != n:
                raise InputError(f"watch: expected bounds of {n} joints, got {len(bounds.lower)}")


def day_in_card(day: TrainedDay | None) -> dict[str, Any] | None:
    """Return what a model's card says of the day that a watch compares with."""
    if day is None:
        return None
    known = {"homing": day.homing, "torque": day.torque, "range": day.outside}
    return {
        "window": day.window,
        "watched": [aspect for aspect, what in known.items() if what is not None],
        "not_watched": list(day.not_watched),
    }
