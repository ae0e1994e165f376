"""The whole law of a robot as lines of operations: friction and drives beside the links, and accelerations.

What `ActuationLoads.torque` and `forward_dynamics` compute on numbers, traced for other systems.
"""

from collections.abc import Sequence

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import SLIDING, ActuationLoads, load_along
from catenary.dynamics.lines import Placed, Terms, mass_matrix_terms, newton_euler_terms, placed, total
from catenary.errors import InputError
from catenary.kernels.tracing import Line, Term, Trace, TracedFunctions
from catenary.robots.model import RobotModel

Rates = Sequence[Term] | Terms


def feedforward_line(model: RobotModel, loads: ActuationLoads | None) -> Line:
    """Trace the torques (n,) that a motion asks of the actuators; inputs q, qd, qdd (n,) and gravity (3,)."""
    model.require_inertia()
    p = placed(model)
    qd, qdd = p.trace.inputs("qd", model.n), p.trace.inputs("qdd", model.n)
    links = newton_euler_terms(p, qd, qdd, moving_base=False)
    return p.trace.line(links if loads is None else _with_loads(p, loads, qd, qdd, links))


def forward_dynamics_line(model: RobotModel, loads: ActuationLoads | None) -> Line:
    """Trace the accelerations (n,) by torques; inputs q, qd, tau (n,) and gravity (3,).

    M qdd = tau - h by M = L D L^T, without a square root.
    """
    model.require_inertia()
    if loads is not None and loads.depends_on_load:
        raise InputError(
            f'robot "{model.name}": its friction depends on the load, and so on the accelerations: forward_dynamics of '
            "it is no line of operations; leave that part out of its loads"
        )
    p, n = placed(model), model.n
    qd, tau = p.trace.inputs("qd", n), p.trace.inputs("tau", n)
    still = [0.0] * n
    asked = newton_euler_terms(p, qd, still, moving_base=False)  # type: ignore[arg-type]  # zeros, as symbols would be
    M = mass_matrix_terms(p)
    if loads is not None:
        asked = _with_loads(p, loads, qd, still, asked)
        M = [[M[i][j] + float(added) for j, added in enumerate(row)] for i, row in enumerate(loads.rotors)]
    x: list[Term] = [tau[k] - asked[k] for k in range(n)]
    L: list[list[Term]] = [[0.0] * n for _ in range(n)]
    D: list[Term] = []
    for j in range(n):
        scaled = [L[j][k] * D[k] for k in range(j)]
        D.append(M[j][j] - total(L[j][k] * scaled[k] for k in range(j)))
        for i in range(j + 1, n):
            rest = M[i][j] - total(L[i][k] * scaled[k] for k in range(j))
            L[i][j] = rest / D[j]
    for i in range(n):
        x[i] = x[i] - total(L[i][k] * x[k] for k in range(i))
    x = [x[i] / D[i] for i in range(n)]
    for i in reversed(range(n)):
        x[i] = x[i] - total(L[k][i] * x[k] for k in range(i + 1, n))
    return p.trace.line(x)


def friction_line(loads: ActuationLoads) -> Line:
    """Trace the torques (n,) of friction and constants; inputs qd (n,), and where it depends on it carried (n,)."""
    trace, n = Trace(), loads.n
    qd = trace.inputs("qd", n)
    return trace.line(_friction_terms(trace, loads, qd, trace.inputs("carried", n) if loads.depends_on_load else qd))


def drives_line(loads: ActuationLoads) -> Line:
    """Trace the torques (n,) of rotors, springs and known torques; inputs q and qdd (n,)."""
    trace = Trace()
    return trace.line(_drive_terms(trace, loads, trace.inputs("q", loads.n), trace.inputs("qdd", loads.n)))


def _with_loads(p: Placed, loads: ActuationLoads, qd: Terms, qdd: Rates, links: list[Term]) -> list[Term]:
    """Return the torques of links with what friction, rotors, springs and known torques ask besides."""
    carried = [a + b for a, b in zip(links, _drive_terms(p.trace, loads, p.q, qdd), strict=True)]
    return [a + b for a, b in zip(carried, _friction_terms(p.trace, loads, qd, carried), strict=True)]


def _drive_terms(trace: Trace, loads: ActuationLoads, q: Terms, qdd: Rates) -> list[Term]:
    out: list[Term] = [0.0] * loads.n
    for known in loads.actuation.known_torques:
        s = _along(known.combination, q)
        load: Term = 0.0
        for coefficient in known.polynomial:
            load = load * s + float(coefficient)
        _add(out, known.along, load)
    for term, value in zip(loads.terms, map(float, loads.values), strict=True):
        if term.kind in ("motor_inertia", "spring"):
            c = term.combination
            along = load_along(term, _along(c, q), 0.0, _along(c, qdd), 0.0, 0.0, TracedFunctions(trace))
            _add(out, c, value * along)
    return out


def _friction_terms(trace: Trace, loads: ActuationLoads, qd: Terms, carried: Rates) -> list[Term]:
    out: list[Term] = [0.0] * loads.n
    smooth = loads.actuation.coulomb_velocity
    for term, value in zip(loads.terms, map(float, loads.values), strict=True):
        if term.kind in (*SLIDING, "offset"):
            c = term.combination
            along = load_along(term, 0.0, _along(c, qd), 0.0, _along(c, carried), smooth, TracedFunctions(trace))
            _add(out, c, value * along)
    return out


def _add(out: list[Term], along: Floats, load: Term) -> None:
    for k, factor in enumerate(along):
        if factor != 0.0:
            out[k] = out[k] + load * float(factor)


def _along(combination: Floats, values: Rates) -> Term:
    return total(values[k] * float(factor) for k, factor in enumerate(combination) if factor != 0.0)
