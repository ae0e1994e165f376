"""What loads a robot's joints besides its links: friction, motor inertia, springs, known torques; pure data.

Every effect acts along a combination c of the robot's coordinates: on s = c . q it makes the scalar load f, and the
actuators must supply tau = c f more. So friction between two coupled joints, or of a motor behind a gear, is a term
like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from catenary.arrays import Floats, frozen
from catenary.errors import InputError
from catenary.robots.plausible import FARTHEST, MOST_FACTOR, check_names, check_within

Weighting = Literal["none", "range", "spread", "residual"]
ActuationKind = Literal[
    "coulomb", "viscous", "offset", "asymmetric", "stribeck", "load", "presliding", "motor_inertia", "spring"
]


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction on the rate v = c . qd, each part identified if set.

    coulomb sign(v) + viscous v + offset, and, where a recording shows them:
    asymmetric |v|: viscous friction that differs by direction (Coulomb friction that does is `offset`);
    stribeck sign(v) exp(-(v / v_s)^2): more, or less, friction at low speed [Armstrong-Helouvry, Dupont, Canudas de
    Wit, "A survey of models, analysis tools and compensation methods", Automatica 30(7), 1994];
    load sign(v) |what the links ask along c|: gears and cables rub with what they carry;
    presliding: friction that builds up over a distance x_s after every reversal, z' = v - |v| z / x_s, in units of x_s
    [Dahl, "A solid friction model", 1968], as on cables and elastic drives; in steady sliding it is sign(v).
    """

    name: str
    combination: Floats  # (n,)
    coulomb: bool = True
    viscous: bool = True
    offset: bool = True
    asymmetric: bool = False
    stribeck: float | None = None  # v_s [rad/s or m/s]; none when None
    load: bool = False
    presliding: float | None = None  # x_s [rad or m]; none when None


@dataclass(frozen=True, eq=False)
class MotorInertia:
    """Inertia of a rotor that turns with c . qdd [kg m2 or kg]."""

    name: str
    combination: Floats  # (n,)


@dataclass(frozen=True)
class LeverSpring:
    """A straight spring from a fixed anchor to the end of a lever that turns by t = angle + c . q.

    Its length is l = sqrt(r^2 + h^2 - 2 r h cos t), its torque on t is stiffness r h sin(t) / l (l - rest).
    """

    arm: float  # [m] r, length of the lever
    anchor: float  # [m] h, from the lever's axis to the anchor
    rest: float  # [m] length without force
    angle: float  # [rad] t where c . q is zero


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring on c . q: linear, the torque stiffness * (c . q), or on a lever."""

    name: str
    combination: Floats  # (n,)
    lever: LeverSpring | None = None


@dataclass(frozen=True, eq=False)
class KnownTorque:
    """A load that is known beforehand, such as a cable's: the polynomial of c . q along `along`.

    tau = along * polynomial(c . q), subtracted from measured torques before anything is fitted.
    """

    name: str
    combination: Floats  # (n,)
    along: Floats  # (n,)
    polynomial: Floats  # (k,) high power first [Nm or N]


class ActuationTerm(NamedTuple):
    """One parameter beside those of the links."""

    kind: ActuationKind
    name: str  # of the friction, rotor or spring
    combination: Floats  # (n,)
    lever: LeverSpring | None = None
    scale: float = 0.0  # v_s of Stribeck friction, x_s of presliding friction


@dataclass(frozen=True)
class SignalFilter:
    """How recordings of this robot are filtered: zero-phase Butterworth, samples cut, resampling."""

    order: int = 4  # of one pass; the filter goes forth and back
    cutoff_hz: float = 10.0
    cut_samples: int = 100  # left out at either end, where the filter has not settled
    period_samples: int | None = None  # of the excitation, whose first period is reported too
    rate_hz: float | None = None  # of recordings with time stamps; their median one if None


@dataclass(frozen=True, eq=False)
class Actuation:
    """What loads the joints besides the links, with this robot's defaults for identification."""

    friction: tuple[Friction, ...] = ()
    motor_inertia: tuple[MotorInertia, ...] = ()
    springs: tuple[Spring, ...] = ()
    known_torques: tuple[KnownTorque, ...] = ()
    filter: SignalFilter = field(default_factory=SignalFilter)
    weighting: Weighting = "range"
    coulomb_velocity: float = 0.0  # [rad/s or m/s] v0 of tanh(v / v0); a sign function at 0
    effort_scale: Floats | None = None  # (n,) [Nm or N per unit] of recordings that hold raw efforts
    values: Floats | None = (
        None  # (k,) SI, numbers of `actuation_terms`, where they are known: of an identified robot
    )

    def __post_init__(self) -> None:
        for term in self.terms:
            for key, value in vars(term).items():
                if isinstance(value, np.ndarray):
                    object.__setattr__(term, key, frozen(value))
        if self.effort_scale is not None:
            object.__setattr__(self, "effort_scale", frozen(self.effort_scale))
        if self.values is not None:
            object.__setattr__(self, "values", frozen(self.values))

    @property
    def terms(self) -> tuple[Friction | MotorInertia | Spring | KnownTorque, ...]:
        """Every effect."""
        return (*self.friction, *self.motor_inertia, *self.springs, *self.known_torques)

    def moves(self, coordinate: int) -> bool:
        """Return whether any effect acts on a coordinate."""
        return any(term.combination[coordinate] != 0.0 for term in self.terms)


def actuation_terms(actuation: Actuation, *, static: bool = False) -> tuple[ActuationTerm, ...]:
    """Return the parameters in the order of their columns; at rest only constants and springs are left."""
    terms: list[ActuationTerm] = []
    for friction in actuation.friction:
        name, c = friction.name, friction.combination
        given: tuple[tuple[ActuationKind, bool, float], ...] = (
            ("coulomb", friction.coulomb, 0.0),
            ("viscous", friction.viscous, 0.0),
            ("offset", friction.offset, 0.0),
            ("asymmetric", friction.asymmetric, 0.0),
            ("stribeck", friction.stribeck is not None, friction.stribeck or 0.0),
            ("load", friction.load, 0.0),
            ("presliding", friction.presliding is not None, friction.presliding or 0.0),
        )
        terms += [
            ActuationTerm(kind, name, c, None, scale)
            for kind, has, scale in given
            if has and (kind == "offset" or not static)
        ]
    if not static:
        terms += [ActuationTerm("motor_inertia", m.name, m.combination) for m in actuation.motor_inertia]
    return (*terms, *(ActuationTerm("spring", s.name, s.combination, s.lever) for s in actuation.springs))


def default_actuation(joint_names: Sequence[str]) -> Actuation:
    """Return friction and a constant on every coordinate, as assumed of a robot whose file says nothing."""
    rows = np.eye(len(joint_names))
    return Actuation(friction=tuple(Friction(name, row) for name, row in zip(joint_names, rows, strict=True)))


def check_actuation(where: str, actuation: Actuation, n: int) -> None:
    """Refuse effects that do not fit the robot.

    Raises:
        InputError: A combination of another length or of zeros, two terms of one kind and name, or a lever spring
            whose length can become zero; the message names the term.
    """
    for kind in ("friction", "motor_inertia", "springs", "known_torques"):
        terms = getattr(actuation, kind)
        check_names(f"{where}: {kind.replace('_', ' ')}", [term.name for term in terms])
        names = [term.name for term in terms]
        for term in terms:
            what = f'{where}: {kind.replace("_", " ")} "{term.name}"'
            if names.count(term.name) > 1:
                raise InputError(f"{what}: is there twice")
            if term.combination.shape != (n,) or not np.isfinite(term.combination).all():
                raise InputError(f"{what}: expected {n} finite factors, got {term.combination}")
            check_within(f"{what}: factor", term.combination, MOST_FACTOR, "")
            along = getattr(term, "along", None)
            if along is not None and (along.shape != (n,) or not np.isfinite(along).all()):
                raise InputError(f"{what}: expected {n} finite factors along which it acts, got {along}")
            if not term.combination.any():
                raise InputError(f"{what}: acts on no coordinate")
            lever = getattr(term, "lever", None)
            if lever is not None and not (0.0 < lever.arm < lever.anchor):
                raise InputError(f"{what}: expected an arm above 0 and shorter than the anchor's distance")
            if lever is not None:
                check_within(f"{what}: lever", [lever.anchor, lever.rest, lever.angle], FARTHEST, "m or rad")
    for friction in actuation.friction:
        for key in ("stribeck", "presliding"):
            scale = getattr(friction, key)
            if scale is not None and not 0.0 < scale < np.inf:
                raise InputError(
                    f'{where}: friction "{friction.name}": {key}: expected above zero, got {scale}'
                )
    if actuation.values is not None:
        count = len(actuation_terms(actuation))
        if actuation.values.shape != (count,) or not np.isfinite(actuation.values).all():
            raise InputError(f"{where}: values: expected {count} finite numbers, got {actuation.values}")
    if actuation.effort_scale is not None and actuation.effort_scale.shape != (n,):
        raise InputError(f"{where}: effort scale: expected {n} factors, got {len(actuation.effort_scale)}")
