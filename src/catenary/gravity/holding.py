"""What holds an arm still in a loop, on a base that stands or turns."""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.loop_kernels import new_workspace, newton_euler_torque
from catenary.robots.model import RobotModel


class HoldingKernel:
    """Torque that holds one robot still against its base, gravity and the base's turning included.

    At a point r of the arm gravity is not gamma, that of the base's origin, but
    gamma - alpha x r - omega x (omega x r), and turning the links along takes moments of their inertia too: this is
    inverse_dynamics at zero joint motion on a moving base. On a base at rest it is gravity_torque.

    Not for two threads at once: calls share work arrays.
    """

    def __init__(self, model: RobotModel) -> None:
        """Take a robot with inertia, and compile.

        Raises:
            MissingInertiaError: Links without inertia.
        """
        model.require_inertia()
        self.model = model
        n = model.n
        self._q, self._qd, self._qdd, self._tau = np.zeros((4, n))
        self._gravity, self._rates, self._flat = np.zeros(3), np.zeros((2, 3)), new_workspace(model)

    def __call__(self, q: Floats, gravity: Floats, base_rates: Floats, *, qd: Floats | None = None) -> Floats:
        """Return torques (n,) [Nm|N] at q (n,) [rad|m]; NaN in gives NaN out.

        Args:
            q: (n,) float64.
            gravity: (3,) free-fall acceleration less that of the base's origin, in base axes [m/s2].
            base_rates: (2, 3) angular velocity and acceleration of the base [rad/s, rad/s2].
            qd: (n,) velocities of the joints [rad/s|m/s], whose torques C(q, qd) qd come on top; at rest when None.
        """
        self._q[:], self._gravity[:], self._rates[:] = q, gravity, base_rates
        self._qd[:] = 0.0 if qd is None else qd
        m = self.model
        newton_euler_torque(
            m.tree, m.coupling, m.offset, self._q, self._qd, self._qdd, self._gravity, self._rates,
            self._flat, self._tau,
        )  # fmt: skip
        return self._tau.copy()
