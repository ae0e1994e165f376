"""Tool compensation of a wrist's force/torque sensor: contact wrench without the tool's weight, inertia and zero.

wrench = sign (reading - bias) - zero - load; the load is m (g - a) and its moment about the sensor's origin, in its
axes, by recursive Newton-Euler (dynamics/symbolic.py) at the joints' positions and rates at the time of the reading.
"""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.robot_kernels import forward_kinematics_kernel
from catenary.dynamics.symbolic import carried_load_line
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from catenary.robots.link_inertia import LinkInertia, symmetric
from catenary.robots.model import Frame, RobotModel
from catenary.sensing.wrist_tool import WristTool, weigh_tool
from catenary.spatial import STANDARD_GRAVITY, Pose, angle_between
from catenary.verdict.finding import Finding

_WINDOW_S = 0.03  # [s] of joint states for an acceleration
_LEAST_STATES, _KEPT_STATES = 4, 400  # least number at low rates; history for delayed readings at 1 kHz
_VELOCITY_WEIGHT_S = 0.01  # [s] weight of velocity errors relative to position errors
_STILL_SPEED = 0.02  # [rad/s or m/s] of a joint at rest
_DWELL_S, _SETTLE_S = 0.7, 0.2  # [s] at rest for a pose, of which the first are discarded
_APART_RAD = 0.2  # [rad] between directions of gravity of different poses
_ZERO_S, _ZERO_PATIENCE_S = 0.5, 5.0  # [s] averaging time of a zero, and timeout for rest
_NOISE_READINGS = 200.0  # averaged for the sensor's noise
_SMOOTHING_S = 0.5  # [s] time constant that separates contact from drift
_CONTACT_SIGMAS = 4.0  # standard deviations beyond which a force is contact, not drift
_DRAG_POSES, _DRAG_SIGMAS = 6, 4.0  # poses examined for drag, and standard deviations that their median exceeds
# relative error of the tool's inertial load: by a parabola up to now, and by one centred on a past time
_LAGGING_SHARE, _CENTERED_SHARE = 0.05, 0.02


def tool_line(model: RobotModel, tool: WristTool) -> Line:
    """Trace a tool's load on its sensor, force and moment in the sensor's axes.

    Args:
        tool: Inertial parameters, and the frame of the sensor.

    Returns:
        Line with inputs q, qd, qdd (n,) and gravity (3,), and output wrench (6,) [N, Nm].
    """
    link, pose = model.frame(tool.frame or None)
    body = LinkInertia(tool.mass, tool.center, symmetric(tool.inertia))
    return carried_load_line(model, Frame(link, pose @ Pose(tool.rotation, np.zeros(3))), body)


class JointMotion:
    """Estimate joint positions, velocities and accelerations by a parabola through recent joint states.

    The parabola spans 30 ms up to the newest state, and lags; with `wait` it is centred on the time, twice `wait`
    wide, and has little lag.

    Args:
        wait: Age of the times asked for, relative to the newest state [s]; 0 or more.
    """

    def __init__(self, n: int, wait: float = 0.0) -> None:
        self.n, self.wait = n, float(as_not_negative("wait", wait))
        self._window = 2.0 * self.wait or _WINDOW_S
        self._states = deque[tuple[float, Floats, Floats]](maxlen=_KEPT_STATES)

    @property
    def newest(self) -> float:
        """Time of the newest state [s]; -infinity before the first."""
        return self._states[-1][0] if self._states else -np.inf

    def put(self, time: float, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Add q (n,) [rad|m] and, if measured, qd (n,) at a time [s]; states that are not newer are ignored."""
        rates = np.full(self.n, np.nan) if qd is None else as_array("qd", qd, (self.n,), finite=False)
        if time > self.newest:
            self._states.append((time, as_array("q", q, (self.n,)).copy(), rates.copy()))

    def at(self, time: float) -> Floats:
        """Return q, qd and qdd (3, n) at a time [s]; derivatives that the states do not determine are zero."""
        end = max(min(time + 0.5 * self._window, self.newest), self._states[0][0])
        recent = list[tuple[float, Floats, Floats]]()
        for state in reversed(self._states):
            if len(recent) >= _LEAST_STATES and state[0] < end - self._window:
                break
            if state[0] <= end:
                recent.append(state)
        times, q, qd = (np.array(column) for column in zip(*recent, strict=True))
        t, one = times - times[0], np.ones(len(times))
        A, y = np.column_stack([one, t, 0.5 * t * t]), q
        if np.isfinite(qd).all():
            A = np.vstack([A, _VELOCITY_WEIGHT_S * np.column_stack([0.0 * one, one, t])])
            y = np.vstack([q, _VELOCITY_WEIGHT_S * qd])
        scale = np.array([1.0, self._window, self._window**2])  # equal magnitudes: undetermined terms become zero
        fit, ahead = np.linalg.lstsq(A / scale, y, rcond=1e-8)[0] / scale[:, None], time - times[0]
        return np.array([[1.0, ahead, 0.5 * ahead**2], [0.0, 1.0, ahead], [0.0, 0.0, 1.0]]) @ fit


class RestPose(NamedTuple):
    """Mean reading of a sensor in a pose at rest."""

    q: Floats  # (n,) [rad|m]
    reading: Floats  # (6,) mean [N, Nm]
    noise: float  # standard deviation of the mean of forces [N]
    gravity: Floats  # (3,) in base axes [m/s2]


class RestPoses:
    """Collect rest poses of unlike gravity in the sensor's frame (None: the tip); newer replace similar ones."""

    def __init__(self, model: RobotModel, frame: str | None = None) -> None:
        model.frame(frame)
        self.model, self.frame = model, frame
        self.poses: list[RestPose] = []
        self._dwell: list[tuple[float, Floats, Floats]] = []

    def add(self, time: float, q: Floats, qd: Floats, reading: Floats, gravity: Floats) -> bool:
        """Add a reading (6,) with q and qd (n,) and gravity (3,) of its time [s]; return true for a new pose."""
        if np.abs(qd).max() > _STILL_SPEED:
            self._dwell.clear()
            return False
        self._dwell.append((time, q, reading))
        begin = self._dwell[0][0]
        if time - begin < _DWELL_S:
            return False
        readings = np.array([row for at, _, row in self._dwell if at - begin >= _SETTLE_S])
        self._dwell.clear()
        if len(readings) < 4:
            return False
        halves = [part.mean(axis=0) for part in np.array_split(readings, 2)]
        noise = float(np.sqrt(np.mean((halves[0] - halves[1])[:3] ** 2))) / 2.0
        new = RestPose(q, readings.mean(axis=0), noise, gravity)
        down = self._down(new)
        kept = [pose for pose in self.poses if angle_between(self._down(pose), down) > _APART_RAD]
        is_new = len(kept) == len(self.poses)
        self.poses = [*kept, new]
        return is_new

    def weigh(self) -> tuple[WristTool, list[Finding]]:
        """Fit the tool to the poses by `weigh_tool`; return it with findings."""
        q, readings, noise, gravity = (np.array(column) for column in zip(*self.poses, strict=True))
        placed = forward_kinematics(self.model, q, self.frame)
        rms = float(np.sqrt(np.mean(noise**2)))
        return weigh_tool(readings[:, :3], readings[:, 3:], placed, gravity, noise=rms)

    def _down(self, pose: RestPose) -> Floats:
        return pose.gravity @ forward_kinematics(self.model, pose.q, self.frame).rotation


class ToolReading(NamedTuple):
    """Contact wrench without the tool's own load, and its standard deviations."""

    wrench: Floats  # (6,) force [N] and moment about the frame's origin [Nm], in the frame's axes
    deviation: Floats  # (6,) [N, Nm] by the sensor's noise, the tool's parameters, the zero and the residual load


class ToolCompensation:
    """Subtract the tool's load from readings: call `motion.put` for joint states, `update` for each reading.

    Without `inertia` the inertial load stays in the wrench and is part of its deviation.

    Examples:
        >>> gravity, arm = 9.81 * np.vstack([np.eye(3), -np.eye(3)]), catenary.load_robot("puma560")
        >>> tool = catenary.fit_wrist_tool(0.5 * gravity, np.cross([0.0, 0.0, 0.1], 0.5 * gravity), gravity)
        >>> compensation = catenary.ToolCompensation(arm, tool)
        >>> compensation.motion.put(0.0, np.zeros(6))
        >>> reading = compensation.update(0.0, [0.0, 0.0, -4.905, 0.0, 0.0, 0.0], [0.0, 0.0, -9.81])
        >>> reading.wrench.shape
        (6,)
    """

    def __init__(
        self,
        model: RobotModel,
        tool: WristTool,
        *,
        frame: str | None = None,
        inertia: bool = False,
        drift: float = 0.0,
        wait: float = 0.0,
        gravity_deviation: float = 0.0,
    ) -> None:
        """Configure the compensation, and compile its kernel.

        Args:
            tool: Tool behind the sensor, as `weigh_tool` returns it.
            frame: Frame of the robot for axes and origin of wrenches; the sensor's own when None.
            inertia: Subtract the inertial load, too.
            drift: Largest drift rate of the sensor's zero, [N/s] and a tenth of it [Nm/s], that is followed without
                contact; 0 or more.
            wait: Delay of readings relative to the newest joint state [s]; see `JointMotion`.
            gravity_deviation: Standard deviation of gravity [m/s2].
        """
        self.model, self.tool, self.inertia = model, tool, inertia
        self.motion, self.rests = JointMotion(model.n, wait), RestPoses(model, tool.frame or None)
        self._rate = float(as_not_negative("drift", drift)) * np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
        self._load = Kernel("tool-load", tool_line(model, tool), (6,)).ready()
        self._sensor = forward_kinematics_kernel(model, tool.frame or None)
        self._target = None if frame is None else forward_kinematics_kernel(model, frame)
        self.zero = np.zeros(6)  # beyond the tool's bias
        self._zero_variance = np.r_[tool.force_bias_deviation, tool.torque_bias_deviation] ** 2
        self._model_variance = _tool_variance(tool, float(as_not_negative("gravity_deviation", gravity_deviation)))
        self._noise, self._before, self._count = np.zeros(6), np.full(6, np.nan), 0.0  # variance; reading before
        self._time = self._followed = np.nan
        self._smooth, self._zeroing = np.zeros(6), list[tuple[float, Floats]]()
        self._requested_at, self.complaint = np.nan, ""

    def begin_zero(self, time: float) -> None:
        """Zero the sensor: average its reading beyond the tool's load over the next half second at rest."""
        self._requested_at, self.complaint = time, ""
        self._zeroing.clear()

    @property
    def is_zeroing(self) -> bool:
        """A zero was requested and is not complete."""
        return bool(np.isfinite(self._requested_at))

    def update(self, time: float, reading: ArrayLike, gravity: ArrayLike) -> ToolReading:
        """Return the contact wrench of a reading (6,), gravity (3,) in base axes, SI; a joint state comes first."""
        raw, down = as_array("reading", reading, (6,)), as_array("gravity", gravity, (3,))
        q, qd, qdd = self.motion.at(time)
        resting, moving = self._load(q, 0.0 * qd, 0.0 * qdd, down), self._load(q, qd, qdd, down)
        beyond = self.tool.sign * (raw - self.tool.bias) - (moving if self.inertia else resting)
        self._learn_noise(raw)
        if self.is_zeroing:
            self._take_zero(time, beyond, bool(np.abs(qd).max() <= _STILL_SPEED))
        share = _CENTERED_SHARE if self.motion.wait else _LAGGING_SHARE
        lag = (moving - resting) * (share if self.inertia else 1.0)
        unsure = self._model_variance + self._zero_variance + lag**2
        self._follow(time, beyond, unsure)
        waited = self._rate * max(0.0, time - self._followed) if np.isfinite(self._followed) else 0.0 * self._rate
        if self.rests.add(time, q, qd, raw, down) and len(self.rests.poses) >= _DRAG_POSES:
            self._look_for_drag()
        X = self._to_target(q)
        variance = unsure + self._noise + waited**2
        return ToolReading(X @ (beyond - self.zero), np.sqrt(X**2 @ variance))

    def _learn_noise(self, raw: Floats) -> None:
        """Update the noise variance by half the squared differences of readings, which motion hardly affects."""
        if np.isfinite(self._before).all():
            self._count = min(self._count + 1.0, _NOISE_READINGS)
            self._noise += (0.5 * (raw - self._before) ** 2 - self._noise) / self._count
        self._before = raw.copy()

    def _take_zero(self, time: float, beyond: Floats, is_still: bool) -> None:
        if not is_still:
            self._zeroing.clear()
            if time - self._requested_at > _ZERO_PATIENCE_S:
                self._requested_at, self.complaint = np.nan, "no zero: the arm is moving"
            return
        self._zeroing.append((time, beyond))
        if time - self._zeroing[0][0] >= _ZERO_S:
            rows = np.array([row for _, row in self._zeroing])
            self.zero, self._smooth = rows.mean(axis=0), np.zeros(6)
            halves = [part.mean(axis=0) for part in np.array_split(rows, 2)]
            self._zero_variance = 0.25 * (halves[0] - halves[1]) ** 2 + self._noise / len(rows)
            self._requested_at, self._followed = np.nan, time

    def _follow(self, time: float, beyond: Floats, unsure: Floats) -> None:
        """Track the zero's drift, limited in rate, while there is no contact."""
        elapsed = time - self._time if np.isfinite(self._time) else 0.0
        self._time = time
        self._smooth += min(1.0, max(0.0, elapsed) / _SMOOTHING_S) * (beyond - self.zero - self._smooth)
        bound = _CONTACT_SIGMAS * np.sqrt(unsure + 0.05 * self._noise)
        if (np.abs(self._smooth) <= bound).all():
            step = np.clip(self._smooth, -self._rate * elapsed, self._rate * elapsed)
            self.zero, self._smooth, self._followed = self.zero + step, self._smooth - step, time

    def _look_for_drag(self) -> None:
        """Report forces that remain at rest in half of the last poses or more, which no contact explains."""
        still = np.zeros(self.model.n)
        poses = self.rests.poses[-_DRAG_POSES:]
        loads = np.array([self._load(pose.q, still, still, pose.gravity) for pose in poses])
        readings = np.array([pose.reading for pose in poses])
        residuals = np.linalg.norm((self.tool.sign * (readings - self.tool.bias) - loads - self.zero)[:, :3], axis=1)
        usual = float(np.sqrt(np.sum((self._model_variance + self._zero_variance)[:3])))
        size = float(np.median(residuals))
        self.complaint = ""
        if size > _DRAG_SIGMAS * usual:
            self.complaint = (
                f"{size:.2g} N remain at rest in {len(poses)} poses, expected {usual:.2g} N: a cable drags, the zero "
                "has drifted, or the tool was changed; zero the sensor, or weigh the tool again"
            )

    def _to_target(self, q: Floats) -> Floats:
        """Return the matrix (6, 6) that transforms wrenches from the sensor to the requested frame."""
        if self._target is None:
            return np.eye(6)
        here, there = self._sensor(q), self._target(q)
        R, lever = there[:, :3].T @ here[:, :3] @ self.tool.rotation, there[:, :3].T @ (here[:, 3] - there[:, 3])
        x, y, z = lever
        moved = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.block([[R, np.zeros((3, 3))], [moved @ R, R]])


def _tool_variance(tool: WristTool, gravity_deviation: float) -> Floats:
    """Return the variance (6,) of a tool's load by its parameters, by gravity, and by the fit's residual."""
    g, reach = STANDARD_GRAVITY, float(np.linalg.norm(tool.center))
    force = (tool.mass_deviation * g) ** 2 + (tool.mass * gravity_deviation) ** 2 + tool.force_rms**2
    moment = (tool.mass * g * tool.center_deviation) ** 2 + (tool.mass * reach * gravity_deviation) ** 2
    return np.concatenate([np.full(3, force), moment + tool.torque_rms**2])
