"""Kernels: a robot's quantities as machine code of its own, for control loops and for many configurations.

A kernel is the recursion traced once for the robot (traced.py), written out and compiled. Compiling takes a second or
two the first time; afterwards the machine code is found in the user's cache (kernel_files.py).
"""

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from types import ModuleType
from weakref import WeakKeyDictionary

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kernel_files import load_source, seal
from catenary.dynamics.numba_source import numba_module
from catenary.dynamics.traced import (
    forward_kinematics_line,
    gravity_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.dynamics.tracing import Line
from catenary.errors import InputError
from catenary.robots.model import RobotModel

MANY = 50_000  # configurations from which compiling for one robot is worth its while
_modules: WeakKeyDictionary[RobotModel, dict[str, ModuleType]] = WeakKeyDictionary()


class _Kernel:
    """Machine code for one quantity of one robot: `into(INPUT..., out)`, which returns nothing and takes no memory.

    It checks the arrays' sizes and nothing else; arrays are of float64, and any number of threads may call it.
    Calling the kernel itself does the same, or gives a new array, and costs 0.1 us more.
    """

    __slots__ = ("into", "shape")

    def __init__(self, module: ModuleType) -> None:
        """Compile a kernel's module, or find it compiled."""
        self.into: Callable[..., None] = module.into
        self.shape: tuple[int, ...] = module.SHAPE
        self.into(*(np.zeros(width) for width in module.WIDTHS), np.empty(self.shape))
        seal(module)


class GravityKernel(_Kernel):
    """Gravity torque of one robot, for loops."""

    __slots__ = ()

    def __call__(self, q: Floats, gravity: Floats, out: Floats | None = None) -> Floats:
        """Torques (n,) [Nm|N] that hold the arm still at q (n,) [rad|m] under gravity (3,) [m/s2].

        NaN in gives NaN in every torque that depends on it.
        """
        tau = np.empty(self.shape) if out is None else out
        self.into(q, gravity, tau)
        return tau


class MassMatrixKernel(_Kernel):
    """Mass matrix of one robot, for loops."""

    __slots__ = ()

    def __call__(self, q: Floats, out: Floats | None = None) -> Floats:
        """Mass matrix (n, n) at q (n,) [rad|m]."""
        M = np.empty(self.shape) if out is None else out
        self.into(q, M)
        return M


class InverseDynamicsKernel(_Kernel):
    """Torques of a motion of one robot on a base at rest, for loops."""

    __slots__ = ()

    def __call__(
        self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, out: Floats | None = None
    ) -> Floats:
        """Torques (n,) [Nm|N]: M(q) qdd + C(q, qd) qd + g(q)."""
        tau = np.empty(self.shape) if out is None else out
        self.into(q, qd, qdd, gravity, tau)
        return tau


class ForwardKinematicsKernel(_Kernel):
    """Pose of one frame of one robot, for loops."""

    __slots__ = ()

    def __call__(self, q: Floats, out: Floats | None = None) -> Floats:
        """Rows of (R_base_frame, origin [m]), (3, 4), at q (n,) [rad|m]."""
        pose = np.empty(self.shape) if out is None else out
        self.into(q, pose)
        return pose


def gravity_kernel(model: RobotModel) -> GravityKernel:
    """What gives a robot's gravity torque in a loop; controllers hold it.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    model.require_inertia()
    return GravityKernel(_module(model, "gravity", lambda: gravity_line(model), (model.n,)))


def mass_matrix_kernel(model: RobotModel) -> MassMatrixKernel:
    """What gives a robot's mass matrix in a loop.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    model.require_inertia()
    return MassMatrixKernel(
        _module(model, "mass-matrix", lambda: mass_matrix_line(model), (model.n, model.n))
    )


def inverse_dynamics_kernel(model: RobotModel) -> InverseDynamicsKernel:
    """What gives the torques of a robot's motion in a loop.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    model.require_inertia()
    return InverseDynamicsKernel(
        _module(model, "inverse-dynamics", lambda: inverse_dynamics_line(model), (model.n,))
    )


def forward_kinematics_kernel(model: RobotModel, frame: str | None = None) -> ForwardKinematicsKernel:
    """What gives the pose of a robot's frame, its tip without a name, in a loop.

    Raises:
        InputError: No frame of that name.
    """
    key = f"pose-{model.tip if frame is None else frame}"
    return ForwardKinematicsKernel(_module(model, key, lambda: forward_kinematics_line(model, frame), (3, 4)))


def write_gravity_torques(
    model: RobotModel, q: Floats, gravity: Floats, out: Floats, *, threads: int = 1
) -> None:
    """Write gravity torques (N, n) at q (N, n), under gravity (N, 3) or (1, 3); inputs are not checked."""
    module = _module(model, "gravity", lambda: gravity_line(model), (model.n,))
    _rows(module, (q, gravity), out, threads)


def write_mass_matrices(model: RobotModel, q: Floats, out: Floats, *, threads: int = 1) -> None:
    """Write mass matrices (N, n, n) at q (N, n); inputs are not checked."""
    module = _module(model, "mass-matrix", lambda: mass_matrix_line(model), (model.n, model.n))
    _rows(module, (q,), out.reshape(len(out), model.n * model.n), threads)


def _rows(module: ModuleType, inputs: tuple[Floats, ...], out: Floats, threads: int) -> None:
    """Run a kernel on many rows, in as many threads as wanted: machine code does not hold Python's lock."""
    if threads < 1:
        raise InputError(f"threads: expected one or more, got {threads}")
    if threads == 1 or len(out) < 2 * threads:
        module.rows(*inputs, out)
    else:
        _in_threads(module.rows, inputs, out, threads)
    if not hasattr(module, "sealed"):
        seal(module)
        module.sealed = True  # type: ignore[attr-defined]


def _in_threads(rows: Callable[..., None], inputs: tuple[Floats, ...], out: Floats, threads: int) -> None:
    edges = np.linspace(0, len(out), threads + 1).astype(int)
    rows(*(a[:1] for a in inputs), out[:1])  # compiles, once
    with ThreadPoolExecutor(threads) as pool:
        jobs = [
            pool.submit(rows, *(a[first:last] if len(a) > 1 else a for a in inputs), out[first:last])
            for first, last in pairwise(edges)
        ]
        for job in jobs:
            job.result()


def _module(
    model: RobotModel, quantity: str, trace: Callable[[], Line], shape: tuple[int, ...]
) -> ModuleType:
    modules = _modules.setdefault(model, {})
    if quantity not in modules:
        stem = re.sub(r"[^A-Za-z0-9]+", "-", f"{model.name} {quantity}")[:80]  # names come from files
        written = numba_module(stem, trace(), shape)
        modules[quantity] = load_source(stem, written.source, written.given)
    return modules[quantity]
