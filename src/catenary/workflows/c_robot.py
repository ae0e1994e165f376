"""A robot's quantities as C functions with their comments: gravity, its regressors, and the whole law of motion.

Every function is a traced line (dynamics/lines.py) that kernels/c99.py writes, so the law stands in no second place.
"""

from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.dynamics.lines import (
    gravity_line,
    gravity_regressor_line,
    holding_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.kernels.c99 import c_comment, c_function, c_sines
from catenary.kernels.tracing import evaluate
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.workflows.c_actuation import c_drives, c_friction


class CFunctions(NamedTuple):
    """Functions of a header."""

    text: list[str]
    names: list[str]


def c_gravity(model: RobotModel, name: str) -> CFunctions:
    """Write `NAME_gravity`, `NAME_gravity_regressor` and `NAME_compact_regressor`, and the sines that all need.

    Raises:
        InputError: The robot's coupling is not finite.
        MissingInertiaError: Links without mass.
    """
    if not np.isfinite(model.coupling).all() or not np.isfinite(model.offset).all():
        raise InputError(f'robot "{model.name}": its coupling holds NaN or infinity')
    gravity, regressor = gravity_line(model), gravity_regressor_line(model)
    links = len(model.link_names)
    q, base = _to_check_at(model, 1), "" if model.base == "base" else f" ({c_comment(model.base)})"
    text = [
        f"/* Gravity in m/s2 in the base frame{base}, whose z points up on a level base: (0, 0, -9.81) there. */",
        f"#define {name.upper()}_PARAMETERS {4 * links}",
        "",
        c_sines(name),
        f"/* Torques out[{model.n}] [Nm, N] that hold the arm still at q[{model.n}] under gravity[3]; never negate.",
        f"   {gravity.operations} sums and products. To check: q = {c_values(q)}, gravity = {c_values(LEVEL)}",
        f"   gives {c_values(evaluate(gravity, q=q, gravity=LEVEL.tolist()))}. */",
        c_function(name, "gravity", gravity),
        f"/* Regressor out[{model.n} x {4 * links}], row by row: torques = out s; s holds, for each link, its mass",
        "   [kg] and first moment about the origin of its frame [kg m]: m, mx, my, mz. Links:",
        f"   {', '.join(c_comment(link) for link in model.link_names)}. {regressor.operations} sums and products. */",
        c_function(name, "gravity_regressor", regressor),
    ]
    functions = [f"{name}_gravity", f"{name}_gravity_regressor"]
    compact = compact_regressor(model)
    if compact.labels:
        text += [
            f"#define {name.upper()}_COMPACT_PARAMETERS {len(compact.labels)}",
            f"/* Compact regressor out[{model.n} x {len(compact.labels)}], row by row: torques = out s; s is without",
            f"   what no joint feels, and equal entries are one. {compact.line().operations} sums and products. s:",
            *(
                f"     {c_comment(label)} [{unit}]"
                for label, unit in zip(compact.labels, compact.units, strict=True)
            ),
            f"   This robot's: {c_values(list(compact.parameters()))}. */",
            c_function(name, "compact_regressor", compact.line()),
        ]
        functions.append(f"{name}_compact_regressor")
    return CFunctions(text, functions)


def c_motion(model: RobotModel, name: str, loads: ActuationLoads | None = None) -> CFunctions:
    """Write what needs moments of inertia: masses, the torques of a motion and of a moving base, the feedforward.

    They come after `c_gravity` of the same name, whose sines they take. With `loads` there are friction, and rotors,
    springs and known torques, too.

    Raises:
        MissingInertiaError: Links without inertia.
    """
    n, mass = model.n, mass_matrix_line(model)
    holding, motion = holding_line(model), inverse_dynamics_line(model)
    at: dict[str, Any] = {array: _to_check_at(model, k + 1) for k, array in enumerate(("q", "qd", "qdd"))}
    at |= {"gravity": LEVEL.tolist(), "omega": [0.1, 0.2, 0.3], "alpha": [0.3, 0.2, 0.1]}
    text = [
        f"/* Mass matrix out[{n} x {n}] at q[{n}], row by row; symmetric: kinetic energy is qd^T out qd / 2. Motors'",
        f"   inertia is not in it. {mass.operations} sums and products. */",
        c_function(name, "mass_matrix", mass),
        "/* On a base that moves, all in its axes: omega[3] and alpha[3], its angular velocity and acceleration",
        "   [rad/s, rad/s2]; gravity[3] is then free fall less the acceleration of the base's origin: what an",
        "   accelerometer there reads, negated. */",
        "",
        f"/* Torques out[{n}] [Nm, N] that hold the arm still on such a base: the term of gravity, and of its turning.",
        f"   {holding.operations} sums and products. */",
        c_function(name, "holding", holding),
        f"/* Torques out[{n}] [Nm, N] of a motion q[{n}], qd[{n}], qdd[{n}] [rad, m, by s and s2] on such a base:",
        f"   M(q) qdd + C(q, qd) qd + g(q). {motion.operations} sums and products. To check:",
        *(f"     {array} = {c_values(values)}" for array, values in at.items()),
        f"   gives {c_values(evaluate(motion, **at))}. */",
        c_function(name, "inverse_dynamics", motion),
    ]
    names = ["mass_matrix", "holding", "inverse_dynamics"]
    if loads is not None:
        text += [c_friction(loads, name), c_drives(loads, name)]
        names += ["friction", "drives"]
    text.append(_feedforward(name, loads))
    return CFunctions(text, [f"{name}_{function}" for function in (*names, "feedforward")])


def _feedforward(name: str, loads: ActuationLoads | None) -> str:
    included = (
        "Friction and drives are in it." if loads is not None else "No friction is known of this robot."
    )
    head = f"""\
/* The whole law in one call: the torques out [Nm, N] that a wanted motion q, qd, qdd asks of the actuators. omega and
   alpha may be NULL on a base that does not turn. {included} */
static inline void {name}_feedforward(const double *q, const double *qd, const double *qdd, const double *gravity,
    const double *omega, const double *alpha, double *out) {{
  const double still[3] = {{0.0, 0.0, 0.0}};
"""
    links = f"  {name}_inverse_dynamics(q, qd, qdd, gravity, omega ? omega : still, alpha ? alpha : still, out);\n"
    if loads is None:
        return f"{head}{links}}}\n"
    carried = "out, " if loads.depends_on_load else ""
    return f"""\
{head}  double friction[{loads.n}], drives[{loads.n}];
  int k;
{links}  {name}_drives(q, qdd, drives);
  for (k = 0; k < {loads.n}; ++k) out[k] += drives[k];
  {name}_friction(qd, {carried}friction);
  for (k = 0; k < {loads.n}; ++k) out[k] += friction[k];
}}
"""


def c_values(values: "Floats | list[float] | tuple[float, ...]") -> str:
    """Write numbers so that reading them gives the same ones."""
    return "(" + ", ".join(f"{value:.17g}" for value in values) + ")"


def _to_check_at(model: RobotModel, step: int) -> list[float]:
    """Return a value for every joint, none of them zero."""
    return [0.1 * (step * k % 7 + 1) for k in range(model.n)]
