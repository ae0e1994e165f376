"""A robot's quantities as kernels: the recursions traced once for the robot (lines.py) and compiled (kernels/).

They are made when they are asked for and kept for as long as the model lives; asking again costs nothing.
"""

import re
from collections.abc import Callable

from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.lines import (
    forward_kinematics_line,
    gravity_line,
    holding_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel

MANY = 50_000  # configurations from which compiling for one robot is worth its while
FEW = 100  # calls for which no kernel is compiled: whoever calls more often does so in a loop
Trace = Callable[[RobotModel], Line]


def gravity_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q, gravity)`, the torques (n,) [Nm|N] that hold the arm still; see `gravity_torque`.

    Inputs are q (n,) [rad|m] and gravity (3,), the free-fall acceleration in base axes [m/s2].

    Raises:
        MissingInertiaError: Links without inertia.
    """
    return known_kernel(model, "gravity", gravity_line, (model.n,)).ready()


def holding_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q, gravity, omega, alpha)`, the torques (n,) [Nm|N] that hold the arm still on a base that moves.

    At a point r of the arm gravity is not that of the base's origin, but gravity - alpha x r - omega x (omega x r),
    and turning the links along takes moments of their inertia too: this is `inverse_dynamics` at zero joint motion.

    Inputs are q (n,) [rad|m]; gravity (3,), the free-fall acceleration less the acceleration of the base's origin
    [m/s2]; omega and alpha (3,), the angular velocity and acceleration of the base [rad/s, rad/s2]; all in base axes.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    return known_kernel(model, "holding", holding_line, (model.n,)).ready()


def inverse_dynamics_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q, qd, qdd, gravity, omega, alpha)`, the torques (n,) [Nm|N] of a motion; see `inverse_dynamics`.

    Inputs are q, qd and qdd (n,) [rad|m, /s, /s2]; gravity, omega and alpha (3,) as in `holding_kernel`, omega and
    alpha zero on a base at rest.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    return known_kernel(model, "inverse-dynamics", inverse_dynamics_line, (model.n,)).ready()


def mass_matrix_kernel(model: RobotModel) -> Kernel:
    """Return `kernel(q)`, the mass matrix (n, n) at q (n,) [rad|m]; see `mass_matrix`.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    return known_kernel(model, "mass-matrix", mass_matrix_line, (model.n, model.n)).ready()


def forward_kinematics_kernel(model: RobotModel, frame: str | None = None) -> Kernel:
    """Return `kernel(q)`, rows of (R_base_frame, origin [m]), (3, 4), at q (n,) [rad|m].

    Args:
        model: The robot.
        frame: Name of the frame; the model's tip when None.

    Raises:
        InputError: No frame of that name.
    """
    name = model.tip if frame is None else frame
    return known_kernel(model, f"pose-{name}", lambda m: forward_kinematics_line(m, name), (3, 4)).ready()


def one_by_kernel(
    model: RobotModel, name: str, trace: Trace, dimensions: int, inputs: tuple[ArrayLike, ...]
) -> Floats | None:
    """Return a quantity at one configuration by the robot's kernel; None for its first calls and for odd inputs.

    The first `FEW` are left to the recursions, so that nothing is compiled for a robot that is asked for little; odd is
    what needs the careful checks: anything but finite, contiguous arrays of float64 of one configuration.
    Many configurations count as a call too, and are odd.

    Args:
        model: The robot.
        name: As in `known_kernel`.
        trace: As in `known_kernel`.
        dimensions: Of the result, each as long as the robot has coordinates.
        inputs: Of the kernel.

    Raises:
        MissingInertiaError: As `trace` has it.
    """
    kernel = model.kernels.get(name, 0)
    if isinstance(kernel, int):  # calls so far
        if kernel < FEW:
            model.kernels[name] = kernel + 1
            return None
        kernel = known_kernel(model, name, trace, (model.n,) * dimensions)
    found: Floats | None = kernel.of_finite(inputs)
    return found


def known_kernel(model: RobotModel, name: str, trace: Trace, shape: tuple[int, ...]) -> Kernel:
    """Return a robot's kernel, traced once for as long as the model is there and compiled when it is used.

    Args:
        model: The robot.
        name: Of the quantity; no other of this robot's may have it.
        trace: Its line of operations.
        shape: Of one configuration's result.
    """
    kernel = model.kernels.get(name)
    if not isinstance(kernel, Kernel):
        title = re.sub(r"[^A-Za-z0-9]+", "-", f"{model.name} {name}")[:80]  # names come from files
        kernel = model.kernels[name] = Kernel(title, trace(model), shape)
    return kernel
