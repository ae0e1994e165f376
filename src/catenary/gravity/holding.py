"""What holds an arm still in a loop, on a base that stands or turns."""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.coordinates import place_tree, to_robot
from catenary.dynamics.loop_kernels import new_workspace, newton_euler_torque, workspace_of
from catenary.dynamics.recursion import gravity_recursion
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import RobotModel, Tree


class HoldingKernel:
    """Torque that holds one robot still against its base, gravity and the base's turning included.

    At a point r of the arm gravity is not gamma, that of the base's origin, but
    gamma - alpha x r - omega x (omega x r), and turning the links along takes moments of their inertia too: this is
    inverse_dynamics at zero joint motion on a moving base. On a base at rest it is gravity_torque, to the bit.
    Torques of the joints' own motion on a turning base (Coriolis) are not in it.

    Not for two threads at once: calls share work arrays.
    """

    def __init__(self, model: RobotModel) -> None:
        """Take a robot with inertia, and compile.

        Raises:
            MissingInertiaError: Links without inertia.
        """
        model.require_inertia()
        self.model = model
        # flat work array, and copies of what comes in: only the copying is compiled anew for read-only arrays
        self._work = new_workspace(model), np.empty(model.n), np.empty(3), np.empty((2, 3)), np.zeros(model.n)
        self(np.zeros(model.n), np.zeros(3), np.zeros((2, 3)))

    def __call__(self, q: Floats, gravity: Floats, base_rates: Floats, out: Floats | None = None) -> Floats:
        """Torques (n,) [Nm|N] at q (n,) [rad|m]; NaN in gives NaN out.

        Args:
            q: (n,) float64.
            gravity: (3,) free-fall acceleration less that of the base's origin, in base axes [m/s2].
            base_rates: (2, 3) angular velocity and acceleration of the base [rad/s, rad/s2].
            out: (n,) to write into; an array of its own when None.
        """
        tau = np.empty(self.model.n) if out is None else out
        model = self.model
        _hold(model.tree, model.coupling, model.offset, *self._work, q, gravity, base_rates, tau)
        return tau


@inlined
def copy_gravity(gravity: Floats, base_rates: Floats, gravity_here: Floats, rates_here: Floats) -> None:
    """Copy what a state tells of gravity into work arrays."""
    for r in range(3):
        gravity_here[r] = gravity[r]
        rates_here[0, r] = base_rates[0, r]
        rates_here[1, r] = base_rates[1, r]


@compiled
def holding_torque(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    gravity: Floats,
    base_rates: Floats,
    zero: Floats,
    flat: Floats,
    out: Floats,
) -> None:
    """Write the torque that holds the arm still; see HoldingKernel.

    Args:
        tree: The robot's tree.
        coupling: (n_tree, n).
        offset: (n_tree,).
        q: (n,) coordinates [rad|m].
        gravity: (3,) apparent, at the base's origin [m/s2].
        base_rates: (2, 3) [rad/s, rad/s2].
        zero: (n,) zeros.
        flat: From `new_workspace`; overwritten.
        out: (n,) written [Nm|N].
    """
    turning = False
    for r in range(3):
        # a NaN is not zero either: it goes on into the torque
        turning |= base_rates[0, r] != 0.0 or base_rates[1, r] != 0.0
    if turning:
        newton_euler_torque(tree, coupling, offset, q, zero, zero, gravity, base_rates, flat, out)
        return
    w = workspace_of(flat, len(tree.parent))
    place_tree(tree, coupling, offset, q, w.trigonometry, w.rotation, w.position)
    g = (gravity[0], gravity[1], gravity[2])
    gravity_recursion(tree, w.rotation, w.position, g, w.mass, w.moment, w.acceleration, w.torque)
    to_robot(coupling, w.torque, out)


@compiled
def _hold(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    flat: Floats,
    q_here: Floats,
    gravity_here: Floats,
    rates_here: Floats,
    zero: Floats,
    q: Floats,
    gravity: Floats,
    base_rates: Floats,
    out: Floats,
) -> None:
    for j in range(len(q_here)):
        q_here[j] = q[j]
    copy_gravity(gravity, base_rates, gravity_here, rates_here)
    holding_torque(tree, coupling, offset, q_here, gravity_here, rates_here, zero, flat, out)
