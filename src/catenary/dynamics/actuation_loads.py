"""Loads of friction, rotors, springs and known torques on the actuators, as columns of a regressor."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_not_negative, one_for_all
from catenary.errors import InputError
from catenary.robots.actuation import Actuation, ActuationTerm, Friction, LeverSpring, actuation_terms
from catenary.robots.model import RobotModel


class ActuationLoads(NamedTuple):
    """The effects on a robot's n coordinates with their numbers, as an identification finds them."""

    n: int
    actuation: Actuation
    terms: tuple[ActuationTerm, ...]
    values: Floats  # (k,) SI, of the terms

    @property
    def depends_on_load(self) -> bool:
        """Whether friction grows with what the links ask of the actuators."""
        return any(term.grows_with_load for term in self.terms)

    @property
    def rotors(self) -> Floats:
        """Contribution of rotors to the mass matrix (n, n)."""
        added = np.zeros((self.n, self.n))
        for term, value in zip(self.terms, self.values, strict=True):
            if term.kind == "motor_inertia":
                added += value * np.outer(term.combination, term.combination)
        return added

    def torque(self, q: Floats, qd: Floats, qdd: Floats, links: Floats | None = None) -> Floats:
        """Return the torques (N, n) [Nm or N] that they ask of the actuators at q, qd, qdd (N, n), known ones too.

        Friction that depends on the load needs the links' torques, `links` (N, n).
        """
        if self.depends_on_load and links is None:
            raise InputError("friction depends on the load: expected the torques of the links as well")
        known = known_torque(self.actuation, q)
        smooth = self.actuation.coulomb_velocity
        columns = actuation_columns(self.terms, q, qd, qdd, smooth)
        if links is not None and self.depends_on_load:
            drives = [k for k, term in enumerate(self.terms) if term.friction is None]
            carried = links + known + columns[:, :, drives] @ self.values[drives]
            columns = actuation_columns(self.terms, q, qd, qdd, smooth, carried)
        return np.asarray(columns @ self.values + known)


def joint_friction(model: RobotModel, coulomb: ArrayLike, viscous: ArrayLike) -> ActuationLoads:
    """Return Coulomb and viscous friction of every joint, as loads of the dynamics.

    Args:
        coulomb, viscous: Friction [Nm|N] and [Nms/rad|Ns/m], one number or (n,) each.
    """
    values = np.empty((model.n, 2))
    for column, (name, friction) in enumerate((("friction", coulomb), ("viscous", viscous))):
        values[:, column] = as_not_negative(name, one_for_all(friction, model.n), (model.n,))
    rows = zip(model.joint_names, np.eye(model.n), strict=True)
    smooth = 0.0 if model.actuation is None else model.actuation.coulomb_velocity
    actuation = Actuation(
        friction=tuple(Friction(name, row, offset=False) for name, row in rows), coulomb_velocity=smooth
    )
    return ActuationLoads(model.n, actuation, actuation_terms(actuation), values.ravel())


def known_loads(model: RobotModel) -> ActuationLoads | None:
    """Return the friction, rotors and springs that a robot brings with their numbers; None if they are not known."""
    actuation = model.actuation
    if actuation is None or actuation.values is None:
        return None
    return ActuationLoads(model.n, actuation, actuation_terms(actuation), actuation.values)


def actuation_columns(
    terms: tuple[ActuationTerm, ...],
    q: Floats,
    qd: Floats,
    qdd: Floats,
    coulomb_velocity: float,
    carried: Floats | None = None,
) -> Floats:
    """Return torques (N, n, k) per unit of each term, at q, qd, qdd (N, n).

    A term acts on s = c . q: the load f(s) appears as c f in the robot's coordinates. `coulomb_velocity` is v0 of
    tanh(v / v0) [rad/s or m/s], a sign function at 0; `carried` (N, n) are torques of all but friction, which
    load-dependent friction grows with.
    """
    loads, combinations = np.empty((len(q), 1, len(terms))), np.empty((q.shape[1], len(terms)))
    for k, term in enumerate(terms):
        loads[:, 0, k] = term_load(term, q, qd, qdd, coulomb_velocity, carried)
        combinations[:, k] = term.combination
    return loads * combinations


def term_load(
    term: ActuationTerm, q: Floats, qd: Floats, qdd: Floats, coulomb_velocity: float, carried: Floats | None = None
) -> Floats:
    """Return the load f(s) (N,) of one actuation term along its coordinate s = c . q, per unit of its parameter.

    Friction is that of steady sliding.

    Args:
        term: The term, with its combination c.
        q, qd, qdd: Positions [rad or m], velocities and accelerations, (N, n) each.
        coulomb_velocity: Velocity at which Coulomb friction is fully developed.
        carried: Torques that the drive carries, (N, n), for friction that grows with them; none when None.
    """
    c = term.combination
    along = 0.0 if carried is None else carried @ c
    load = np.empty(len(q))
    load[:] = load_along(term, q @ c, qd @ c, qdd @ c, along, coulomb_velocity)
    return load


def load_along(
    term: ActuationTerm, s: Any, rate: Any, acceleration: Any, carried: Any, coulomb_velocity: float, f: Any = np
) -> Any:
    """Return the load of one term per unit, in plain arithmetic on numbers, or on symbols with functions f of these."""
    if term.kind == "motor_inertia":
        return acceleration
    if term.friction is None:
        return s if term.lever is None else lever_load(term.lever, s, f)
    load = term.friction.load(rate, term.scale, coulomb_velocity, f)
    if term.friction.grows_with_load:
        return load * f.abs(carried) * (1.0 / float(term.combination @ term.combination))
    return load


def lever_load(lever: LeverSpring, s: Any, f: Any = np) -> Any:
    """Return the torque along s of a spring of stiffness 1 N/m at the end of a lever [Nm], s in rad."""
    t = s + lever.angle
    length = f.sqrt(lever.arm**2 + lever.anchor**2 - 2.0 * lever.arm * lever.anchor * f.cos(t))
    return lever.arm * lever.anchor * f.sin(t) * (1.0 - lever.rest / length)


def known_torque(actuation: Actuation, q: Floats) -> Floats:
    """Return the torques (N, n) [Nm or N] of a robot's known springs, cables and balances.

    Args:
        q: Positions (N, n) [rad or m].
    """
    out = np.zeros(q.shape)
    for term in actuation.known_torques:
        out += np.polyval(term.polynomial, q @ term.combination)[:, None] * term.along
    return out
