"""An arm with a tool behind a force/torque sensor, by Pinocchio's wrench on the body: what the sensor reads, with noise."""

import numpy as np
import pinocchio as pin

from catenary.arrays import Floats
from catenary.robots.catalog import load_robot
from catenary.robots.urdf_export import urdf_text
from catenary.sensing.tool_compensation import RestPoses
from catenary.spatial import LEVEL

ARM = load_robot("ur10e")
POSE = np.array([0.0, -1.2, 1.6, -0.5, 1.5, 0.0])
RANGE = np.array([0.5, 0.4, 0.4, 1.5, 1.5, 2.0])  # [rad] about it, of poses to weigh in
SHARE_OF_TORQUE = 0.03  # [m] noise of torques over that of forces
Q_NOISE, QD_NOISE = 1e-5, 1e-3  # [rad], [rad/s] of joint states


class SensedTool:
    """A drawn tool, its sensor with a bias, and sinusoids of all joints at 1 rad/s at most."""

    def __init__(self, seed: int, *, noise: float = 0.1, axes: Floats | None = None, drift: float = 0.0) -> None:
        """Draw them; noise and drift are of forces [N], [N/s] along x."""
        self.rng = rng = np.random.default_rng(seed)
        self.mass, self.center = rng.uniform(0.4, 3.0), rng.uniform(-0.05, 0.05, 3)
        self.center[2] += 0.08
        self.bias = np.r_[rng.normal(0.0, 5.0, 3), rng.normal(0.0, 0.3, 3)]
        self.axes, self.drift = np.eye(3) if axes is None else axes, drift
        self.noise = noise * np.r_[1.0, 1.0, 1.0, np.full(3, SHARE_OF_TORQUE)]
        self.rates = rng.uniform(0.8, 3.0, 6)
        self.sizes, self.phases = rng.uniform(0.6, 1.0, 6) / self.rates, rng.uniform(0.0, 2.0 * np.pi, 6)
        self._model = pin.buildModelFromXML(urdf_text(ARM))
        self._data, self._frame = self._model.createData(), self._model.getFrameId(ARM.tip)
        self._body = pin.Inertia(self.mass, self.center, np.zeros((3, 3)))

    def motion(self, t: float) -> tuple[Floats, Floats, Floats]:
        """Positions, velocities and accelerations at a time."""
        x = self.rates * t + self.phases
        return (
            POSE + self.sizes * np.sin(x), self.sizes * self.rates * np.cos(x), -self.sizes * self.rates**2 * np.sin(x)
        )  # fmt: skip

    def joints(self, t: float) -> tuple[Floats, Floats]:
        """Positions and velocities as they are measured."""
        q, qd, _ = self.motion(t)
        return q + Q_NOISE * self.rng.normal(size=6), qd + QD_NOISE * self.rng.normal(size=6)

    def load(self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats = LEVEL) -> Floats:
        """Force and moment of the tool on its sensor (6,), in the frame's axes."""
        pin.forwardKinematics(self._model, self._data, pin.neutral(self._model) + q, qd, qdd)
        pin.updateFramePlacements(self._model, self._data)
        of = self._model, self._data, self._frame, pin.ReferenceFrame.LOCAL
        v, a = pin.getFrameVelocity(*of), pin.getFrameAcceleration(*of)
        a.linear -= self._data.oMf[self._frame].rotation.T @ gravity
        wrench = self._body * a + v.cross(self._body * v)
        return -np.asarray(wrench.vector)

    def reads(self, load: Floats, t: float = 0.0) -> Floats:
        """What the sensor reads of a load."""
        seen = np.r_[self.axes @ load[:3], self.axes @ load[3:]]
        return seen + self.bias + self.noise * self.rng.normal(size=6) + self.drift * t * np.eye(6)[0]

    def weighed(self, poses: int = 12, rate: float = 500.0) -> RestPoses:
        """Poses at rest of 0.75 s."""
        rests = RestPoses(ARM)
        for k in range(poses):
            q = POSE + RANGE * self.rng.uniform(-1.0, 1.0, 6)
            load = self.load(q, 0.0 * q, 0.0 * q)
            for i in range(int(0.75 * rate)):
                rests.add(5.0 * k + i / rate, q, 0.0 * q, self.reads(load), LEVEL)
        return rests
