"""A robot's quantities as functions of other systems: JAX, CasADi, SymPy and C99, all from one straight line."""

import logging
from collections.abc import Callable
from functools import partial
from typing import Any, Literal, get_args

from catenary.dynamics import symbolic
from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel

ExportedQuantity = Literal[
    "gravity", "holding", "mass_matrix", "inverse_dynamics", "inverse_dynamics_on_moving_base", "feedforward",
    "forward_dynamics", "forward_kinematics", "standard_gravity_regressor", "compact_regressor",
]  # fmt: skip
_OF_LINKS = ("inverse_dynamics", "inverse_dynamics_on_moving_base", "forward_dynamics")  # alone, but for `loads`
_WITH_LOADS = (*_OF_LINKS, "feedforward")
ExportTarget = Literal["jax", "casadi", "sympy", "c99"]
_log = logging.getLogger(__name__)


def export_function(
    model: RobotModel,
    quantity: ExportedQuantity,
    to: ExportTarget,
    *,
    frame: str | None = None,
    loads: ActuationLoads | None = None,
) -> Any:
    """Return a quantity of a robot as a function of another system, for derivatives, batches, MPC or printing.

    | quantity | inputs | result |
    |---|---|---|
    | gravity | q (n,), gravity (3,) | torques (n,) that hold the arm, as `gravity_torque` |
    | holding | q, gravity, omega, alpha (3,) | the same on a base that turns: its angular velocity and acceleration |
    | mass_matrix | q | (n, n) |
    | inverse_dynamics | q, qd, qdd (n,), gravity | torques (n,) of a motion on a base at rest |
    | inverse_dynamics_on_moving_base | q, qd, qdd, gravity, omega, alpha | the same on a base that turns |
    | feedforward | q, qd, qdd, gravity | inverse_dynamics with the loads that the robot brings, as an identified one |
    | forward_dynamics | q, qd, tau (n,), gravity | accelerations (n,) by torques, as `forward_dynamics` |
    | forward_kinematics | q | rows of (R_base_frame, origin), (3, 4) |
    | standard_gravity_regressor | q, gravity | (n, 4 n_links), columns m, mx, my, mz |
    | compact_regressor | q, gravity | (n, p), as `compact_regressor(model).Z` |

    On a moving base `gravity` is free-fall acceleration less that of the base's origin; all three are in base axes.
    The robot's numbers are constants of the function. It looks at no value: NaN in gives NaN out.

    Args:
        to: "jax": a jitted function of one configuration, in float64 (`jax.vmap` for batches).
            "casadi": a `casadi.Function` with named inputs.
            "sympy": a `SymbolicFunction`, expressions that print as LaTeX.
            "c99": the text of a header with one function, NAME_QUANTITY(inputs..., out), also C++.
        frame: Frame of the forward kinematics; the tip when None.
        loads: Friction, rotors, springs and known torques of the four dynamics; when None feedforward has those that
            the robot brings, the others are of its links alone. Presliding friction is as in steady sliding.

    Raises:
        InputError: No such quantity, target or frame.
        MissingInertiaError: Links without inertia, for torques and masses.
        MissingPackageError: The target's package is not installed.
        NotReadyError: JAX computes in float32.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> header = catenary.export_function(arm, "gravity", "c99")
        >>> "two_link_gravity(const double *q, const double *gravity, double *out)" in header
        True
    """
    if quantity not in get_args(ExportedQuantity):
        raise InputError(f'quantity "{quantity}": expected one of {", ".join(get_args(ExportedQuantity))}')
    if to not in get_args(ExportTarget):
        raise InputError(f'to "{to}": expected one of {", ".join(get_args(ExportTarget))}')
    if frame is not None and quantity != "forward_kinematics":
        raise InputError(f'frame "{frame}": only forward_kinematics has one, not {quantity}')
    if loads is not None and quantity not in _WITH_LOADS:
        raise InputError(f"loads: only {', '.join(_WITH_LOADS)} have them, not {quantity}")
    known = known_loads(model)
    if quantity in _OF_LINKS and loads is None and known is not None:
        _log.warning('robot "%s": %s is of its links alone; loads= adds friction and rotors', model.name, quantity)
    loads = known if quantity == "feedforward" and loads is None else loads
    line, shape, result = _traced(model, quantity, frame, loads)
    if to != "c99":
        from catenary.kernels.jax_casadi_sympy import casadi_function, jax_function, sympy_function

        if to == "casadi":
            return casadi_function(quantity, line, shape, result)
        return (jax_function if to == "jax" else sympy_function)(line, shape)
    from catenary.kernels.c99 import c_function, c_name, c_sines

    name = c_name(model.name)
    guard = f"CATENARY_{name.upper()}_SINES"  # headers of several quantities may stand in one file
    sines = f"#include <math.h>\n\n#ifndef {guard}\n#define {guard}\n{c_sines(name)}#endif\n"
    return f"{sines}\n{c_function(name, quantity, line)}"


def _traced(
    model: RobotModel, quantity: ExportedQuantity, frame: str | None, loads: ActuationLoads | None
) -> tuple[Line, tuple[int, ...], str]:
    n, links = model.n, len(model.link_names)
    if quantity == "compact_regressor":
        regressor = compact_regressor(model)
        return regressor.line(), (n, len(regressor.labels)), "Z"
    torques = partial(symbolic.inverse_dynamics_line, loads=loads)
    table: dict[str, tuple[Callable[[RobotModel], Line], tuple[int, ...], str]] = {
        "gravity": (symbolic.gravity_line, (n,), "tau"),
        "holding": (symbolic.holding_line, (n,), "tau"),
        "mass_matrix": (symbolic.mass_matrix_line, (n, n), "M"),
        "inverse_dynamics": (partial(torques, moving_base=False), (n,), "tau"),
        "inverse_dynamics_on_moving_base": (torques, (n,), "tau"),
        "feedforward": (partial(torques, moving_base=False), (n,), "tau"),
        "forward_dynamics": (partial(symbolic.forward_dynamics_line, loads=loads), (n,), "qdd"),
        "forward_kinematics": (partial(symbolic.forward_kinematics_line, frame=frame), (3, 4), "pose"),
        "standard_gravity_regressor": (symbolic.gravity_regressor_line, (n, 4 * links), "Z"),
    }
    traced, shape, result = table[quantity]
    return traced(model), shape, result
