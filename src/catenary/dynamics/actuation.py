"""What friction, rotors, springs and known torques ask of the actuators, as columns of a regressor."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.robots.actuation import Actuation, Friction, LeverSpring
from catenary.robots.model import RobotModel

ActuationKind = Literal["coulomb", "viscous", "offset", "motor_inertia", "spring"]
NEVER_NEGATIVE: tuple[ActuationKind, ...] = ("coulomb", "viscous", "motor_inertia", "spring")


class ActuationTerm(NamedTuple):
    """One parameter beside those of the links."""

    kind: ActuationKind
    name: str  # of the friction, rotor or spring
    combination: Floats  # (n,)
    lever: LeverSpring | None = None


class ActuationLoads(NamedTuple):
    """The effects on a robot's n coordinates with their numbers, as an identification finds them."""

    n: int
    actuation: Actuation
    terms: tuple[ActuationTerm, ...]
    values: Floats  # (k,) SI, of the terms

    def torque(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """Return the torques (N, n) [Nm or N] that they ask of the actuators at q, qd, qdd (N, n), known ones too."""
        columns = actuation_columns(self.terms, q, qd, qdd, self.actuation.coulomb_velocity)
        torque: Floats = columns @ self.values + known_torque(self.actuation, q)
        return torque


def joint_friction(model: RobotModel, coulomb: ArrayLike, viscous: ArrayLike) -> ActuationLoads:
    """Return friction of every joint with given numbers.

    Args:
        model: The robot; its file may state at which speed Coulomb friction is smooth.
        coulomb: One number for all joints or (n,), zero or more [Nm or N].
        viscous: Likewise [Nms/rad or Ns/m].

    Raises:
        InputError: Another number of them, a negative one, NaN or infinity.
    """
    values = np.empty((model.n, 2))
    for column, (name, given) in enumerate((("friction", coulomb), ("viscous", viscous))):
        values[:, column] = as_array(name, given, () if np.ndim(given) == 0 else (model.n,))
        if (values[:, column] < 0.0).any():
            raise InputError(f"{name}: expected zero or more of every joint, got {values[:, column]}")
    rows = zip(model.joint_names, np.eye(model.n), strict=True)
    smooth = 0.0 if model.actuation is None else model.actuation.coulomb_velocity
    actuation = Actuation(
        friction=tuple(Friction(name, row, offset=False) for name, row in rows), coulomb_velocity=smooth
    )
    return ActuationLoads(model.n, actuation, actuation_terms(actuation), values.ravel())


def actuation_terms(actuation: Actuation, *, static: bool = False) -> tuple[ActuationTerm, ...]:
    """Return the parameters in the order of their columns; at rest only constants and springs are left."""
    terms: list[ActuationTerm] = []
    for friction in actuation.friction:
        for kind in ("coulomb", "viscous", "offset"):
            if getattr(friction, kind) and (kind == "offset" or not static):
                terms.append(ActuationTerm(kind, friction.name, friction.combination))
    if not static:
        terms += [ActuationTerm("motor_inertia", m.name, m.combination) for m in actuation.motor_inertia]
    return (*terms, *(ActuationTerm("spring", s.name, s.combination, s.lever) for s in actuation.springs))


def actuation_columns(
    terms: tuple[ActuationTerm, ...], q: Floats, qd: Floats, qdd: Floats, coulomb_velocity: float
) -> Floats:
    """Return torques (N, n, k) per unit of each term, at q, qd, qdd (N, n).

    A term acts on s = c . q: Coulomb friction by the sign of its rate (tanh(rate / v0) with `coulomb_velocity` v0
    above zero), viscous friction by its rate, a rotor by its second derivative, a linear spring by s itself. The load
    f(s) appears as c f in the robot's coordinates.
    """
    out = np.zeros((*q.shape, len(terms)))
    for k, term in enumerate(terms):
        c = term.combination
        if term.kind == "coulomb":
            load = np.tanh(qd @ c / coulomb_velocity) if coulomb_velocity > 0.0 else np.sign(qd @ c)
        elif term.kind == "viscous":
            load = qd @ c
        elif term.kind == "offset":
            load = np.ones(len(q))
        elif term.kind == "motor_inertia":
            load = qdd @ c
        elif term.lever is not None:
            load = lever_load(term.lever, q @ c)
        else:
            load = q @ c
        out[:, :, k] = load[:, None] * c
    return out


def lever_load(lever: LeverSpring, s: Floats) -> Floats:
    """Return the torque along s of a spring of stiffness 1 N/m at the end of a lever [Nm], s in rad."""
    t = lever.angle + s
    length = np.sqrt(lever.arm**2 + lever.anchor**2 - 2.0 * lever.arm * lever.anchor * np.cos(t))
    load: Floats = lever.arm * lever.anchor * np.sin(t) / length * (length - lever.rest)
    return load


def known_torque(actuation: Actuation, q: Floats) -> Floats:
    """Return torques (N, n) [Nm or N] that are known beforehand, at q (N, n)."""
    out = np.zeros(q.shape)
    for term in actuation.known_torques:
        out += np.polyval(term.polynomial, q @ term.combination)[:, None] * term.along
    return out
