"""A motion of some joints of a robot, as a motion of all of them: the others stand still."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.trajectories.reference import SampledTrajectory, Trajectory


class Embedded(SampledTrajectory):
    """A trajectory of the joints numbered `joints`, the others held at `q_hold`."""

    def __init__(self, trajectory: Trajectory, joints: Sequence[int], q_hold: ArrayLike) -> None:
        """Place a trajectory among a robot's joints.

        Args:
            trajectory: Of len(joints) joints.
            joints: Where they are among the robot's, each once.
            q_hold: (n,) where the robot's joints stand [rad or m]; not read for those that move.

        Raises:
            InputError: The numbers do not fit together.
        """
        self._trajectory, self._joints, self.duration = trajectory, list(joints), trajectory.duration
        self._hold = as_array("q_hold", q_hold, (None,)).copy()
        moving = len(trajectory(0.0).q)
        if moving != len(self._joints) or len(set(self._joints)) != moving:
            raise InputError(f"joints: expected {moving} different ones, got {self._joints}")
        if any(not 0 <= j < len(self._hold) for j in self._joints):
            raise InputError(
                f"joints: expected numbers of the robot's {len(self._hold)} joints, got {self._joints}"
            )

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references of all joints at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        parts = self._trajectory.sample(times)
        full = np.zeros((3, len(parts[0]), len(self._hold)))
        full[0] = self._hold
        full[:, :, self._joints] = parts
        return full[0], full[1], full[2]
