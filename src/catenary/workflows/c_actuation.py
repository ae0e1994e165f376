"""Friction, rotors, springs and known torques as C: a block for each effect, with its numbers.

A line of operations has no sign, tanh or root, so these are written from their numbers as `ActuationLoads.torque`
computes them (dynamics/actuation.py), one effect after the other.
"""

import re
from itertools import groupby

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import SLIDING, ActuationLoads
from catenary.kernels.c99 import c_comment
from catenary.robots.actuation import ActuationTerm, KnownTorque

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
    step = f"{value!r} * " + (
        f"tanh(s / {smooth!r})" if smooth > 0.0 else "(s > 0.0 ? 1.0 : s < 0.0 ? -1.0 : s)"
    )
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
