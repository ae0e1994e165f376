"""Sinusoids of the tool along one Cartesian axis after the other: the tracking test of gravity compensation.

Dynamic-gravity-compensation paper, section IV: "sequential sinusoidal motions along each Cartesian direction",
amplitude 3.1 inch, period 4 s, two full cycles. The tool moves by amplitude sin(phase) about its start.
A sine starts at full speed; the paper leaves that to the robot's controller. Here the phase accelerates and
decelerates over a quarter of the period, so that every axis starts and ends at rest at the start pose, and takes that
much longer.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline

from catenary.arrays import Floats, as_array, as_positive
from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.raven_inverse_kinematics import raven_path
from catenary.errors import InputError, LimitError, UnreachablePoseError
from catenary.robots.model import RobotModel
from catenary.spatial import Pose
from catenary.trajectories.reference import SampledTrajectory
from catenary.trajectories.smoothed_path import SmoothedPath

AMPLITUDE_M = 3.1 * 0.0254  # [m] dynamic-gravity-compensation paper, section IV
_PERIOD_S = 4.0  # [s] the same
CYCLES = 2  # the same
_RAMP_PERIODS = 0.25  # of the period, ours

# velocity limits if a model has none: near a singularity joints would have to move faster than any robot
_FASTEST = {"rad": 10.0, "m": 1.0}  # [rad/s], [m/s], ours
_DEGREE = 5  # of the splines: position to acceleration are smooth, and zero at both ends where they must be


class CartesianSinusoids(SampledTrajectory):
    """Trajectory of a robot's tip along the axes of its base frame, one after the other.

    Joint positions are computed at construction and interpolated by splines of degree 5: an infeasible motion is
    refused before anything moves.
    """

    def __init__(
        self,
        model: RobotModel,
        q_start: ArrayLike,
        *,
        amplitude: float = AMPLITUDE_M,
        period: float = _PERIOD_S,
        cycles: int = CYCLES,
        axes: Sequence[str] = ("x", "y", "z"),
        step: float = 0.01,
    ) -> None:
        """Solve the inverse kinematics of the whole motion.

        The tip of a robot of six coordinates or more keeps its orientation.

        Args:
            q_start: (n,) start, to which the motion returns after each axis [rad|m].
            amplitude: To either side [m].
            period: Of a sine [s].
            cycles: Per axis, at least 1.
            axes: Of the base frame: x, y, z.
            step: Sampling interval of the inverse kinematics [s].

        Raises:
            LimitError: A pose is out of reach, or a joint exceeds its velocity limit.
        """
        start = as_array("q_start", q_start, (model.n,))
        swing, seconds = as_positive("amplitude", amplitude), float(as_positive("period", period))
        step = float(as_positive("step", step))
        if cycles < 1:
            raise InputError(f"cycles: expected at least 1, got {cycles}")
        if not axes or any(axis not in ("x", "y", "z") for axis in axes):
            raise InputError(f"axes: expected some of x, y, z, got {list(axes)}")
        self.axes = tuple(axes)
        self._phases = _phases(len(self.axes), seconds, cycles, _RAMP_PERIODS * seconds)
        self.duration = self._phases.duration
        self._swing = swing * np.array([[name == axis for name in "xyz"] for axis in self.axes], float)
        self._start = forward_kinematics(model, start)

        times = np.linspace(0.0, self.duration, max(int(np.ceil(self.duration / step)), 2 * _DEGREE) + 1)
        q = self._solve(model, start, times)
        self._refuse_leaps(model, times, q)
        # zero velocity and acceleration at both ends
        zeros = [(1, np.zeros(model.n)), (2, np.zeros(model.n))]
        ends: Any = (zeros, zeros)  # SciPy's type stubs know no lists of derivatives
        self._q: BSpline = make_interp_spline(times, q, k=_DEGREE, bc_type=ends)
        self._qd, self._qdd = self._q.derivative(1), self._q.derivative(2)

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        t = as_array("times", times, (None,))
        inside = np.clip(t, 0.0, self.duration)
        q, qd, qdd = self._q(inside), self._qd(inside), self._qdd(inside)
        at_rest = (t <= 0.0) | (t >= self.duration)
        qd[at_rest], qdd[at_rest] = 0.0, 0.0
        return q, qd, qdd

    def tip_positions(self, times: ArrayLike) -> Floats:
        """Return the desired tip positions in the base frame, (N, 3) [m], at times (N,) [s]."""
        phases, _, _ = self._phases.sample(times)
        return np.asarray(self._start.position + np.sin(phases) @ self._swing)

    def _solve(self, model: RobotModel, start: Floats, times: Floats) -> Floats:
        positions = self.tip_positions(times)
        if model.closed_form == "raven2":
            rotations = np.broadcast_to(self._start.rotation, (len(times), 3, 3))
            try:
                return raven_path(model, rotations, positions, start)
            except UnreachablePoseError:
                pass  # solved pose by pose below, to report the time
        q = np.empty((len(times), model.n))
        q_k = start
        for k, position in enumerate(positions):
            try:
                q_k = inverse_kinematics(model, Pose(self._start.rotation, position), q_k, position_tolerance=1e-10)
            except UnreachablePoseError as error:
                raise LimitError(f"{self._when(times[k], position)}: {error}") from error
            q[k] = q_k
        return q

    def _refuse_leaps(self, model: RobotModel, times: Floats, q: Floats) -> None:
        fallback = [_FASTEST[unit] for unit in model.joint_units]
        fastest = np.where(np.isinf(model.velocity_limit), fallback, model.velocity_limit)
        speed = np.abs(np.diff(q, axis=0)) / np.diff(times)[:, np.newaxis]
        too_fast = np.argwhere(speed > fastest)
        if len(too_fast):
            k, j = (int(i) for i in too_fast[0])
            unit = model.joint_units[j]
            raise LimitError(
                f"{self._when(times[k], self.tip_positions(times[k : k + 1])[0])}: joint "
                f'"{model.joint_names[j]}" would move at {speed[k, j]:.4g} {unit}/s; '
                f"expected at most {fastest[j]:.4g} {unit}/s: a singularity is near"
            )

    def _when(self, time: float, position: Floats) -> str:
        axis = self.axes[min(int(time / self.duration * len(self.axes)), len(self.axes) - 1)]
        return (
            f"Cartesian sinusoid along {axis}, at {time:.3f} of {self.duration:.3f} s, tip at {np.round(position, 4)} m"
        )


def _phases(axes: int, period: float, cycles: int, ramp: float) -> SmoothedPath:
    """Return the phase of each axis' sine [rad]: it rises through all cycles while those of the others are constant."""
    runs = cycles * period
    begins = np.arange(axes) * (runs + ramp)
    times = np.sort(np.concatenate([begins, begins + runs]))
    phases = np.where(times[:, np.newaxis] > begins, 2.0 * np.pi * cycles, 0.0)
    return SmoothedPath.through(times, phases, ramp)
