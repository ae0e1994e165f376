"""A robot's quantities, evaluated by recursion or by kernels: the recursions traced once for the robot, and compiled.

They are made when they are asked for and kept for as long as the model lives; asking again costs nothing.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics import symbolic
from catenary.kernels.compiled import in_motion
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel

MANY_CONFIGURATIONS = 50_000  # configurations from which compiling for one robot is worth its while
_FEW_CALLS = 100  # calls for which no kernel is compiled: whoever calls more often does so in a loop
Trace = Callable[[RobotModel], Line]


def gravity_kernel(model: RobotModel) -> Kernel:
    """Return the compiled gravity torques of a robot; see `gravity_torque`.

    Args:
        model: The robot; needs inertia.

    Returns:
        `kernel(q, gravity)`, of q (n,) [rad|m] and the free-fall acceleration in base axes (3,) [m/s2]: the torques
        (n,) [Nm|N] that hold the arm still.

    Raises:
        MissingInertiaError: Links without inertia.

    Examples:
        >>> hold = catenary.gravity_kernel(catenary.load_robot("raven2"))
        >>> hold(np.array([0.5, 1.6, 0.4]), np.array([0.0, 0.0, -9.81])).round(3)
        array([-0.068, -0.456,  2.133])
    """
    return known_kernel(model, "gravity", symbolic.gravity_line, (model.n,)).ready()


def holding_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q, gravity, omega, alpha)`, the torques (n,) [Nm|N] that hold the arm still on a base that moves.

    At a point r of the arm gravity is not that of the base's origin, but gravity - alpha x r - omega x (omega x r),
    and turning the links along takes moments of their inertia too: this is `inverse_dynamics` at zero joint motion.

    Inputs are q (n,) [rad|m]; gravity (3,), the free-fall acceleration less the acceleration of the base's origin
    [m/s2]; omega and alpha (3,), the angular velocity and acceleration of the base [rad/s, rad/s2]; all in base axes.
    """
    return known_kernel(model, "holding", symbolic.holding_line, (model.n,)).ready()


def inverse_dynamics_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q, qd, qdd, gravity, omega, alpha)`, the torques (n,) [Nm|N] of a motion; see `inverse_dynamics`.

    Inputs are q, qd and qdd (n,) [rad|m, /s, /s2]; gravity, omega and alpha (3,) as in `holding_kernel`, omega and
    alpha zero on a base at rest.
    """
    return known_kernel(model, "inverse-dynamics", symbolic.inverse_dynamics_line, (model.n,)).ready()


def mass_matrix_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q)`, the mass matrix (n, n) at q (n,) [rad|m]; see `mass_matrix`."""
    return known_kernel(model, "mass-matrix", symbolic.mass_matrix_line, (model.n, model.n)).ready()


def forward_kinematics_kernel(model: RobotModel, frame: str | None = None) -> Kernel:
    """Return compiled forward kinematics of a frame: `kernel(q)`, q (n,) [rad|m], is (R_base_frame, origin [m]) (3, 4).

    Args:
        frame: Name of the frame; the tip when None.
    """
    name = model.tip if frame is None else frame
    return known_kernel(model, f"pose-{name}", lambda m: symbolic.forward_kinematics_line(m, name), (3, 4)).ready()


class DynamicQuantity(NamedTuple):
    """One quantity of a robot and its one evaluator: the recursion at first, the robot's traced kernel beyond.

    The recursion interprets the robot's tree; it needs no compiling for this robot. The kernel takes over from the
    101st single configuration on, but not while `run_loop` moves a robot, which half a second of compiling would leave
    alone; and for 50,000 configurations at once. It differs in rounding only.
    """

    name: str  # of the kernel
    trace: Trace
    recursion: Callable[..., None]  # compiled: (tree, coupling, offset, inputs as rows..., out)
    dimensions: int  # of a result, each as long as the robot has coordinates

    def kernel(self, model: RobotModel) -> Kernel:
        """Return the robot's kernel, traced; it is compiled when it is used."""
        return known_kernel(model, self.name, self.trace, (model.n,) * self.dimensions)

    def of_one(self, model: RobotModel, inputs: tuple[ArrayLike, ...]) -> Floats | None:
        """Return the quantity at one configuration by the kernel; None for its first calls and for odd inputs.

        Odd is what needs the careful checks: anything but finite, contiguous arrays of float64 of one configuration.
        Many configurations count as a call too, and are odd.
        """
        kernel = model.kernels.get(self.name, 0)
        if isinstance(kernel, int):  # calls so far
            if kernel < _FEW_CALLS or in_motion.get():
                model.kernels[self.name] = kernel + 1
                return None
            kernel = self.kernel(model)
        return kernel.of_finite(inputs)

    def of_rows(self, model: RobotModel, inputs: tuple[Floats, ...]) -> Floats:
        """Return the quantity at N configurations: the first input has N rows, others N, or one for all."""
        count = len(inputs[0])
        if count >= MANY_CONFIGURATIONS:
            return self.kernel(model).rows(*inputs)
        out = np.empty((count, *(model.n,) * self.dimensions))
        self.recursion(model.tree, model.coupling, model.offset, *inputs, out)
        return out


def known_kernel(model: RobotModel, name: str, trace: Trace, shape: tuple[int, ...]) -> Kernel:
    """Return a robot's kernel of a quantity, traced once in the model's lifetime and compiled at its first use.

    Args:
        model: The robot, which keeps its kernels.
        name: Name of the quantity, unique for the robot.
        shape: Shape of one configuration's result.
    """
    kernel = model.kernels.get(name)
    if not isinstance(kernel, Kernel):
        title = re.sub(r"[^A-Za-z0-9]+", "-", f"{model.name} {name}")[:80]  # names come from files
        kernel = model.kernels[name] = Kernel(title, trace(model), shape)
    return kernel
