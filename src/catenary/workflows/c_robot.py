"""A robot's quantities as C functions with their comments: gravity, its regressors, the law of motion, its actuation.

Every rigid quantity is a traced line (dynamics/lines.py) that kernels/c99.py writes, so the law stands in no second
place. Friction, rotors, springs and known torques are a block for each effect, with its numbers: a line of operations
has no sign, tanh or root, so these are written as `ActuationLoads.torque` computes them (dynamics/actuation.py).
"""

import re
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import SLIDING, ActuationLoads
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
from catenary.robots.actuation import ActuationTerm, KnownTorque
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL


class CFunctions(NamedTuple):
    """Functions of a header."""

    text: list[str]
    names: list[str]


def c_gravity(model: RobotModel, name: str) -> CFunctions:
    """Write `NAME_gravity`, `NAME_gravity_regressor` and `NAME_compact_regressor`, and the sines that all need."""
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
            *(f"     {c_comment(label)} [{unit}]" for label, unit in zip(compact.labels, compact.units, strict=True)),
            f"   This robot's: {c_values(list(compact.parameters()))}. */",
            c_function(name, "compact_regressor", compact.line()),
        ]
        functions.append(f"{name}_compact_regressor")
    return CFunctions(text, functions)


def c_motion(model: RobotModel, name: str, loads: ActuationLoads | None = None) -> CFunctions:
    """Write what needs moments of inertia: masses, the torques of a motion and of a moving base, the feedforward.

    They come after `c_gravity` of the same name, whose sines they take. With `loads` there are friction, and rotors,
    springs and known torques, too.
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
    included = "Friction and drives are in it." if loads is not None else "No friction is known of this robot."
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


FRICTION = (*SLIDING, "offset")


def c_friction(loads: ActuationLoads, name: str) -> str:
    """Write `NAME_friction(qd, out)`: what friction and constants ask of the actuators, in steady sliding.

    Where friction depends on the load it is `NAME_friction(qd, carried, out)`.
    """
    smooth = loads.actuation.coulomb_velocity
    how = (
        f"Coulomb friction goes through zero as tanh(speed / {smooth!r})"
        if smooth > 0.0
        else "Coulomb friction has the sign of the speed, and is none at rest"
    )
    pairs = [pair for pair in _numbered(loads) if pair[0].kind in FRICTION]
    extra, carried = "", ""
    if loads.depends_on_load:
        extra = "const double *carried, "
        carried = f" It grows with carried[{loads.n}], the torques of links and drives."
    blocks = []
    for effect_name, group in groupby(pairs, key=lambda pair: pair[0].name):
        effect = list(group)
        parts = [_friction(term, value, smooth) for term, value in effect]
        blocks.append(_block(f"friction {effect_name}", effect[0][0].combination, "qd", parts))
    return "\n".join(
        [
            f"/* Friction: torques out[{loads.n}] [Nm, N] that it asks of the actuators at speeds qd[{loads.n}], as",
            f"   identified. {how}.{carried} */",
            f"static inline void {name}_friction(const double *qd, {extra}double *out) {{",
            *_zeros(loads.n),
            *blocks,
            "  (void)qd;",
            "}",
            "",
        ]
    )


def c_drives(loads: ActuationLoads, name: str) -> str:
    """Write `NAME_drives(q, qdd, out)`: what rotors, springs and known torques ask of the actuators."""
    blocks = [
        _block(
            f"{term.kind} {term.name}",
            term.combination,
            "qdd" if term.kind == "motor_inertia" else "q",
            [_drive(term, value)],
        )
        for term, value in _numbered(loads)
        if term.kind not in FRICTION
    ]
    blocks += [_known(term) for term in loads.actuation.known_torques]
    return "\n".join(
        [
            f"/* Rotors, springs and known torques: torques out[{loads.n}] [Nm, N] beyond links and friction. */",
            f"static inline void {name}_drives(const double *q, const double *qdd, double *out) {{",
            *_zeros(loads.n),
            *blocks,
            "  (void)q;",
            "  (void)qdd;",
            "}",
            "",
        ]
    )


def _numbered(loads: ActuationLoads) -> list[tuple[ActuationTerm, float]]:
    return list(zip(loads.terms, map(float, loads.values), strict=True))


def _friction(term: ActuationTerm, value: float, smooth: float) -> str:
    if term.kind == "viscous":
        return f"{value!r} * s"
    if term.kind == "asymmetric":
        return f"{value!r} * fabs(s)"
    if term.kind == "offset":
        return repr(value)
    step = f"{value!r} * " + (f"tanh(s / {smooth!r})" if smooth > 0.0 else "(s > 0.0 ? 1.0 : s < 0.0 ? -1.0 : s)")
    if term.kind == "stribeck":
        return f"{step} * exp(-(s / {term.scale!r}) * (s / {term.scale!r}))"
    if term.kind == "load":
        c = term.combination
        along = _sum_of_joints(c, "carried")
        return f"{step} * fabs({along}) / {float(c @ c)!r}"
    return step


def _drive(term: ActuationTerm, value: float) -> str:
    if term.lever is None:
        return f"{value!r} * s"
    r, h, rest, angle = term.lever.arm, term.lever.anchor, term.lever.rest, term.lever.angle
    length = f"sqrt({r**2 + h**2!r} - {2.0 * r * h!r} * cos({angle!r} + s))"
    return f"{value * r * h!r} * sin({angle!r} + s) * (1.0 - {rest!r} / {length})"


def _known(term: KnownTorque) -> str:
    load = repr(float(term.polynomial[0]))
    for coefficient in term.polynomial[1:]:
        load = f"({load} * s + {float(coefficient)!r})"
    return _block(f"known torque {term.name}", term.combination, "q", [load], term.along)


def _block(what: str, combination: Floats, of: str, loads: list[str], along: Floats | None = None) -> str:
    """Write one effect: its load on s = c . q, qd or qdd, put out along c, or along another combination."""
    sum_of_joints = _sum_of_joints(combination, of)
    put = combination if along is None else along
    load = " + ".join(loads)
    return "\n".join(
        [
            f"  {{ /* {c_comment(what)} */",
            *([f"    const double s = {sum_of_joints};"] if re.search(r"\bs\b", load) else []),
            f"    const double load = {load};",
            *(f"    out[{k}] += {_factor(float(c))}load;" for k, c in enumerate(put) if c != 0.0),
            "  }",
        ]
    )


def _sum_of_joints(combination: Floats, of: str) -> str:
    return " + ".join(f"{_factor(float(c))}{of}[{k}]" for k, c in enumerate(combination) if c != 0.0)


def _factor(c: float) -> str:
    return "" if c == 1.0 else f"{c!r} * "


def _zeros(n: int) -> list[str]:
    return [f"  out[{k}] = 0.0;" for k in range(n)]
