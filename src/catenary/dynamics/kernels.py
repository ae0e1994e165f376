"""Kernels: a robot's quantities as machine code of its own, for control loops and for many configurations.

A kernel is the recursion traced once for the robot (traced.py), written out and compiled. Compiling takes a second or
two the first time; afterwards the machine code is found in the user's cache (kernel_files.py).
"""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from inspect import Parameter, Signature
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING, Literal
from weakref import WeakKeyDictionary

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.traced import (
    forward_kinematics_line,
    gravity_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.errors import InputError
from catenary.kernels.line_text import widths_of
from catenary.kernels.llvm_kernels import llvm_kernel, llvm_machine
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel

MANY = 50_000  # configurations from which compiling for one robot is worth its while
Backend = Literal["llvm", "c"]
_known: WeakKeyDictionary[RobotModel, dict[str, "Quantity"]] = WeakKeyDictionary()


class Kernel:
    """Machine code for one quantity of one robot: `into(INPUT..., out)`, which takes no memory, and returns `out`.

    Without `out` it gives a new array. It takes contiguous arrays of float64, refuses any other, and looks at no value;
    any number of threads may call it. Calling the kernel itself takes inputs of any layout, also by name.
    """

    # a call is the machine code's own: a method in Python would take longer than most torques
    __slots__ = ("__call__", "backend", "into", "shape")

    def __init__(self, quantity: "Quantity", backend: Backend) -> None:
        """Compile a kernel, or find it compiled; `self.backend` is "llvm" where there is no C compiler."""
        stem, line, self.shape = quantity.stem, quantity.line, quantity.shape
        self.backend: Backend = "llvm"
        self.into: Callable[..., Floats]
        self.__call__: Callable[..., Floats]
        if backend == "c":
            from catenary.kernels.c_compiler import (
                load_extension,
            )  # what it imports takes longer than a kernel

            extension = load_extension(stem, line, self.shape)
            if extension is not None:
                self.backend, self.into = "c", extension.into
                self.__call__ = _or(self.into, _by_copies(self.into, line, self.shape))
                return
        machine = llvm_machine(stem, line, self.shape)
        self.into = llvm_kernel(line, self.shape, machine)
        self.__call__ = machine.call(_by_copies(self.into, line, self.shape))


def _by_copies(into: Callable[..., Floats], line: Line, shape: tuple[int, ...]) -> Callable[..., Floats]:
    """Give a call that copies inputs which are no contiguous arrays of float64, and takes names."""
    given = [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in widths_of(line)]
    signature = Signature([*given, Parameter("out", Parameter.POSITIONAL_OR_KEYWORD, default=None)])

    def call(*arguments: Floats, **named: Floats) -> Floats:
        bound = signature.bind(*arguments, **named)
        bound.apply_defaults()
        *inputs, out = bound.args
        copies = [np.ascontiguousarray(array, dtype=float) for array in inputs]
        return into(*copies, np.empty(shape) if out is None else out)

    return call


def _or(into: Callable[..., Floats], otherwise: Callable[..., Floats]) -> Callable[..., Floats]:
    """Give a call that does something else where `into` refuses."""

    def call(*arguments: Floats, **named: Floats) -> Floats:
        if not named:
            with suppress(InputError):
                return into(*arguments)
        return otherwise(*arguments, **named)

    return call


class GravityKernel(Kernel):
    """Gravity torque of one robot, for loops."""

    __slots__ = ()

    if TYPE_CHECKING:

        def __call__(self, q: Floats, gravity: Floats, out: Floats | None = None) -> Floats:
            """Torques (n,) [Nm|N] that hold the arm still at q (n,) [rad|m] under gravity (3,) [m/s2].

            NaN in gives NaN in every torque that depends on it.
            """
            ...


class MassMatrixKernel(Kernel):
    """Mass matrix of one robot, for loops."""

    __slots__ = ()

    if TYPE_CHECKING:

        def __call__(self, q: Floats, out: Floats | None = None) -> Floats:
            """Mass matrix (n, n) at q (n,) [rad|m]."""
            ...


class InverseDynamicsKernel(Kernel):
    """Torques of a motion of one robot on a base at rest, for loops."""

    __slots__ = ()

    if TYPE_CHECKING:

        def __call__(
            self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, out: Floats | None = None
        ) -> Floats:
            """Torques (n,) [Nm|N]: M(q) qdd + C(q, qd) qd + g(q)."""
            ...


class ForwardKinematicsKernel(Kernel):
    """Pose of one frame of one robot, for loops."""

    __slots__ = ()

    if TYPE_CHECKING:

        def __call__(self, q: Floats, out: Floats | None = None) -> Floats:
            """Rows of (R_base_frame, origin [m]), (3, 4), at q (n,) [rad|m]."""
            ...


def gravity_kernel(model: RobotModel, *, backend: Backend = "llvm") -> GravityKernel:
    """What gives a robot's gravity torque in a loop; controllers hold it.

    Args:
        model: The robot.
        backend: "c" is quicker by up to a third, and takes a C compiler with Python's headers when the kernel is
            first made; without one LLVM makes it all the same, and `kernel.backend` says so.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    model.require_inertia()
    return GravityKernel(_gravity(model), backend)


def mass_matrix_kernel(model: RobotModel, *, backend: Backend = "llvm") -> MassMatrixKernel:
    """What gives a robot's mass matrix in a loop; see `gravity_kernel`."""
    model.require_inertia()
    return MassMatrixKernel(_mass_matrix(model), backend)


def inverse_dynamics_kernel(model: RobotModel, *, backend: Backend = "llvm") -> InverseDynamicsKernel:
    """What gives the torques of a robot's motion in a loop; see `gravity_kernel`."""
    model.require_inertia()
    return InverseDynamicsKernel(_inverse_dynamics(model), backend)


def forward_kinematics_kernel(
    model: RobotModel, frame: str | None = None, *, backend: Backend = "llvm"
) -> ForwardKinematicsKernel:
    """What gives the pose of a robot's frame, its tip without a name, in a loop; see `gravity_kernel`.

    Raises:
        InputError: No frame of that name.
    """
    name = model.tip if frame is None else frame
    quantity = quantity_of(model, f"pose-{name}", lambda m: forward_kinematics_line(m, name), (3, 4))
    return ForwardKinematicsKernel(quantity, backend)


def gravity_module(model: RobotModel) -> ModuleType:
    """The module whose `into` is a robot's gravity torque, for compiled functions to call.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    model.require_inertia()
    return _gravity(model).module()


def inverse_dynamics_module(model: RobotModel) -> ModuleType:
    """The module whose `into` is the torque of a robot's motion on a base at rest; see `gravity_module`."""
    model.require_inertia()
    return _inverse_dynamics(model).module()


def write_gravity_torques(
    model: RobotModel, q: Floats, gravity: Floats, out: Floats, *, threads: int = 1
) -> None:
    """Write gravity torques (N, n) at q (N, n), under gravity (N, 3) or (1, 3); inputs are not checked."""
    write_rows(_gravity(model).module(), (q, gravity), out, threads)


def write_mass_matrices(model: RobotModel, q: Floats, out: Floats, *, threads: int = 1) -> None:
    """Write mass matrices (N, n, n) at q (N, n); inputs are not checked."""
    write_rows(_mass_matrix(model).module(), (q,), out.reshape(len(out), model.n * model.n), threads)


def write_rows(module: ModuleType, inputs: tuple[Floats, ...], out: Floats, threads: int = 1) -> None:
    """Run a quantity's module on many rows, out (N, size), in as many threads as wanted; inputs are not checked.

    Machine code does not hold Python's lock.
    """
    if threads < 1:
        raise InputError(f"threads: expected one or more, got {threads}")
    if threads == 1 or len(out) < 2 * threads:
        module.rows(*inputs, out)
    else:
        _in_threads(module.rows, inputs, out, threads)
    if not hasattr(module, "sealed"):
        from catenary.kernels.numba_files import seal

        seal(module)
        module.sealed = True  # type: ignore[attr-defined]


def _in_threads(rows: Callable[..., None], inputs: tuple[Floats, ...], out: Floats, threads: int) -> None:
    from concurrent.futures import ThreadPoolExecutor  # a tenth of the time that a loop's first kernel takes

    edges = np.linspace(0, len(out), threads + 1).astype(int)
    rows(*(a[:1] for a in inputs), out[:1])  # compiles, once
    with ThreadPoolExecutor(threads) as pool:
        jobs = [
            pool.submit(rows, *(a[first:last] if len(a) > 1 else a for a in inputs), out[first:last])
            for first, last in pairwise(edges)
        ]
        for job in jobs:
            job.result()


@dataclass
class Quantity:
    """A quantity of a robot: what is compiled of it, and its module once it has been asked for."""

    stem: str
    line: Line
    shape: tuple[int, ...]
    loaded: ModuleType | None = None

    def module(self) -> ModuleType:
        """The module for compiled functions and for many rows; see numba_source.py."""
        if self.loaded is None:
            from catenary.kernels.numba_files import load_source  # numba: kernels for Python go without
            from catenary.kernels.numba_source import numba_module

            written = numba_module(self.stem, self.line, self.shape)
            self.loaded = load_source(self.stem, written.source, written.given)
        return self.loaded


def _gravity(model: RobotModel) -> Quantity:
    return quantity_of(model, "gravity", gravity_line, (model.n,))


def _inverse_dynamics(model: RobotModel) -> Quantity:
    return quantity_of(model, "inverse-dynamics", inverse_dynamics_line, (model.n,))


def _mass_matrix(model: RobotModel) -> Quantity:
    return quantity_of(model, "mass-matrix", mass_matrix_line, (model.n, model.n))


def quantity_of(
    model: RobotModel, name: str, trace: Callable[[RobotModel], Line], shape: tuple[int, ...]
) -> Quantity:
    """A quantity of a robot, traced once for as long as the model is there.

    Args:
        model: The robot.
        name: Of the quantity; no other of this robot's may have it.
        trace: Its line of operations.
        shape: Of one configuration's result.
    """
    known = _known.setdefault(model, {})
    if name not in known:
        stem = re.sub(r"[^A-Za-z0-9]+", "-", f"{model.name} {name}")[:80]  # names come from files
        known[name] = Quantity(stem, trace(model), shape)
    return known[name]
