"""A fitted calibration model: what to add to the reported joint positions, and where it may be trusted."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.features import FeatureSet
from catenary.calibration.kernels import Packed
from catenary.calibration.valid_range import ValidRange
from catenary.errors import InputError
from catenary.plant import MotionLog

Target = Literal["error", "position"]


class Predictor(Protocol):
    """A fitted function of features (N, F) to (N, m)."""

    def predict(self, X: Floats) -> Floats:
        """Give (N, m) for features (N, F)."""
        ...

    def pack(self) -> Packed:
        """Give the arrays as compiled loops take them."""
        ...


@dataclass(frozen=True)
class JointGroup:
    """Joints that share their inputs, and what was fitted for them."""

    joints: tuple[int, ...]
    columns: NDArray[np.int64]  # features that they take
    predictor: Predictor
    valid_range: ValidRange
    watched: NDArray[np.int64]  # features that the valid range looks at: those that can leave their range

    def inside(self, X: Floats) -> NDArray[np.bool_]:
        """Whether rows of all features (N, F) lie in the group's valid range, (N,); never true for NaN."""
        complete = np.isfinite(X[:, self.columns]).all(axis=1)
        return complete & self.valid_range.inside(X[:, self.watched])


@dataclass(frozen=True)
class CalibrationModel:
    """What a fit gives; there is no unfitted one.

    `correction` is added to q_nominal. A row outside a group's valid range gets the fixed offset of the
    training data instead.
    """

    kind: str  # "offset", "linear", "polynomial" or "neural"
    preset: str | None
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    features: FeatureSet
    target: Target  # what the predictors give: the joint error, or the joint position (end to end)
    offset: Floats  # (n,) mean error of the training data [rad|m]
    groups: tuple[JointGroup, ...]
    rate_hz: float | None = None  # of the training rows, at which `history` counts; None where not known

    def inside(self, X: Floats) -> NDArray[np.bool_]:
        """Whether features (N, F) lie in the valid range of each joint, (N, n)."""
        inside = np.zeros((len(X), len(self.joint_names)), dtype=bool)
        for group in self.groups:
            inside[:, group.joints] = group.inside(X)[:, None]
        return inside

    def correction(self, X: Floats, q_nominal: Floats) -> Floats:
        """What to add to q_nominal (N, n), (N, n) [rad|m]; NaN features count as outside the valid range.

        Raises:
            InputError: X is not (N, F), or q_nominal not (N, n).
        """
        X = as_array("features", X, (None, len(self.features.names)), finite=False)
        q_nominal = as_array("q_nominal", q_nominal, (len(X), len(self.joint_names)), finite=False)
        correction = np.tile(self.offset, (len(X), 1))
        for group in self.groups:
            rows = np.flatnonzero(group.inside(X))
            prediction = group.predictor.predict(X[np.ix_(rows, group.columns)])
            cells = np.ix_(rows, np.array(group.joints))
            if self.target == "position":
                prediction = prediction - q_nominal[cells]
            correction[cells] = prediction
        return correction

    def calibrate(self, log: MotionLog) -> Floats:
        """Calibrated joint positions of every row of a recording, (N, n) [rad|m].

        Raises:
            InputError: The recording is of other joints, or lacks an input.
        """
        self.require_joints(log)
        return log.q_nominal + self.correction(self.features.matrix(log), log.q_nominal)

    def require_joints(self, log: MotionLog) -> None:
        """Refuse a recording of other joints.

        Raises:
            InputError: Names or units differ; the message shows both.
        """
        if (log.joint_names, log.joint_units) != (self.joint_names, self.joint_units):
            raise InputError(
                f'recording "{log.name}" has joints {_list(log.joint_names, log.joint_units)}; '
                f"the model is for {_list(self.joint_names, self.joint_units)}"
            )


def _list(names: tuple[str, ...], units: tuple[str, ...]) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
