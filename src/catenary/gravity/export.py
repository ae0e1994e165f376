"""A robot's quantities as functions of other systems: JAX, CasADi, SymPy and C99, all from one straight line."""

from collections.abc import Callable
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

from catenary.dynamics.lines import (
    forward_kinematics_line,
    gravity_line,
    gravity_regressor_line,
    holding_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel

ExportedQuantity = Literal[
    "gravity",
    "holding",
    "mass_matrix",
    "inverse_dynamics",
    "inverse_dynamics_on_moving_base",
    "forward_kinematics",
    "gravity_regressor",
    "compact_regressor",
]
ExportTarget = Literal["jax", "casadi", "sympy", "c99"]


class _Traced(NamedTuple):
    line: Line
    shape: tuple[int, ...]
    result: str  # name of the output


def export_function(
    model: RobotModel, quantity: ExportedQuantity, to: ExportTarget, *, frame: str | None = None
) -> Any:
    """Return a quantity of a robot as a function of another system, for derivatives, batches, MPC or printing.

    | quantity | inputs | result |
    |---|---|---|
    | gravity | q (n,), gravity (3,) | torques (n,) that hold the arm, as `gravity_torque` |
    | holding | q, gravity, omega, alpha (3,) | the same on a base that turns: its angular velocity and acceleration |
    | mass_matrix | q | (n, n) |
    | inverse_dynamics | q, qd, qdd (n,), gravity | torques (n,) of a motion on a base at rest |
    | inverse_dynamics_on_moving_base | q, qd, qdd, gravity, omega, alpha | the same on a base that turns |
    | forward_kinematics | q | rows of (R_base_frame, origin), (3, 4) |
    | gravity_regressor | q, gravity | (n, 4 n_links), columns m, mx, my, mz, as `standard_gravity_regressor` |
    | compact_regressor | q, gravity | (n, p), as `compact_regressor(model).Z` |

    On a moving base `gravity` is free-fall acceleration less that of the base's origin; all three are in base axes.
    The robot's numbers are constants of the function. It looks at no value: NaN in gives NaN out.

    Args:
        model: The robot.
        quantity: See above.
        to: "jax": a jitted function of one configuration, in float64 (`jax.vmap` for batches).
            "casadi": a `casadi.Function` with named inputs.
            "sympy": a `SymbolicFunction`, expressions that print as LaTeX.
            "c99": the text of a header with one function, NAME_QUANTITY(inputs..., out), also C++.
        frame: Whose pose forward kinematics gives; the tip when None.

    Raises:
        InputError: No such quantity, target or frame.
        MissingInertiaError: Links without inertia, for torques and masses.
        MissingPackageError: The target's package is not installed.
        NotReadyError: JAX computes in float32.
    """
    if quantity not in get_args(ExportedQuantity):
        raise InputError(f'quantity "{quantity}": expected one of {", ".join(get_args(ExportedQuantity))}')
    if to not in get_args(ExportTarget):
        raise InputError(f'to "{to}": expected one of {", ".join(get_args(ExportTarget))}')
    if frame is not None and quantity != "forward_kinematics":
        raise InputError(f'frame "{frame}": only forward_kinematics has one, not {quantity}')
    line, shape, result = _traced(model, quantity, frame)
    if to == "jax":
        from catenary.kernels.jax_casadi_sympy import jax_function

        return jax_function(line, shape)
    if to == "casadi":
        from catenary.kernels.jax_casadi_sympy import casadi_function

        return casadi_function(quantity, line, shape, result)
    if to == "sympy":
        from catenary.kernels.jax_casadi_sympy import sympy_function

        return sympy_function(line, shape)
    from catenary.kernels.c99 import c_function, c_name, c_sines

    name = c_name(model.name)
    guard = f"CATENARY_{name.upper()}_SINES"  # headers of several quantities may stand in one file
    sines = f"#include <math.h>\n\n#ifndef {guard}\n#define {guard}\n{c_sines(name)}#endif\n"
    return f"{sines}\n{c_function(name, quantity, line)}"


def _traced(model: RobotModel, quantity: ExportedQuantity, frame: str | None) -> _Traced:
    n, links = model.n, len(model.link_names)
    if quantity == "forward_kinematics":
        return _Traced(forward_kinematics_line(model, frame), (3, 4), "pose")
    if quantity == "gravity_regressor":
        return _Traced(gravity_regressor_line(model), (n, 4 * links), "Z")
    if quantity == "compact_regressor":
        regressor = compact_regressor(model)
        return _Traced(regressor.line(), (n, len(regressor.labels)), "Z")
    traces: dict[str, Callable[[RobotModel], Line]] = {
        "gravity": gravity_line,
        "holding": holding_line,
        "mass_matrix": mass_matrix_line,
        "inverse_dynamics": partial(inverse_dynamics_line, moving_base=False),
        "inverse_dynamics_on_moving_base": inverse_dynamics_line,
    }
    square = quantity == "mass_matrix"
    return _Traced(traces[quantity](model), (n, n) if square else (n,), "M" if square else "tau")
