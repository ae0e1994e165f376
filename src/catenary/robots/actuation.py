"""Actuation of a robot's joints: friction, motor inertia, springs, known torques; pure data.

Every effect acts along a combination c of the robot's coordinates: on s = c . q it makes the scalar load f, and the
actuators must supply tau = c f more. So friction between two coupled joints, or of a motor behind a gear, is a term
like any other. These dataclasses are also what stands in files: `[actuation]` of a robot table, and the robot in a file
of identified parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, make_dataclass, replace
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator, ValidationInfo

from catenary.arrays import Floats, Listed, frozen
from catenary.config import IN_FILES, file_keys
from catenary.errors import InputError
from catenary.robots.friction_terms import FRICTION_TERMS, FrictionTerm
from catenary.robots.plausibility import MAX_FACTOR, MAX_LENGTH_M, check_names, check_within

Weighting = Literal["none", "range", "spread", "residual"]


def _combination(value: Any, info: ValidationInfo) -> Floats:
    """Read a combination: a row, or factors by the names of coordinates, which are the context."""
    if not isinstance(value, dict):
        return Listed().read(value)
    names = info.context or ()
    for name, factor in value.items():
        if name not in names:
            raise ValueError(f'acts on unknown coordinate "{name}"; coordinates: {", ".join(names)}')
        if type(factor) not in (int, float) or not np.isfinite(factor):
            raise ValueError(f'factor of "{name}": expected a finite number')
    if not value:
        raise ValueError("expected at least one coordinate")
    return np.array([value.get(name, 0.0) for name in names], dtype=float)


Combination = Annotated[Floats, PlainValidator(_combination), PlainSerializer(np.ndarray.tolist)]  # (n,)
Row = Annotated[Floats, Listed()]
Positive = Annotated[float, Field(gt=0.0)]


@dataclass(frozen=True, eq=False)
class Effect:
    """A load on a combination of coordinates."""

    __pydantic_config__ = file_keys(combination="on")

    name: str
    combination: Combination

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if isinstance(value, np.ndarray):
                object.__setattr__(self, key, frozen(value))


# a field for each term: whether it is there, or its scale
_FrictionParts: Any = make_dataclass(
    "_FrictionParts",
    [
        (term.kind, bool, term.usual) if term.scale is None else (term.kind, Positive | None, None)
        for term in FRICTION_TERMS.values()
    ],
    bases=(Effect,),
    frozen=True,
    eq=False,
)


@dataclass(frozen=True, eq=False)
class Friction(_FrictionParts):  # type: ignore[misc]  # its fields are those of the registry
    """Friction on the rate v = c . qd, with the terms of `FRICTION_TERMS` that are set, each identified."""

    __pydantic_config__ = file_keys(
        combination="on", **{term.kind: term.scale.key for term in FRICTION_TERMS.values() if term.scale is not None}
    )

    recording: str = ""  # that alone has this, beside the friction of all; such as that of another day

    @property
    def parts(self) -> dict[str, float]:
        """The scale of each term that is set, by its kind; 0 for terms without."""
        scales = {kind: getattr(self, kind) for kind in FRICTION_TERMS}
        return {kind: 0.0 if value is True else value for kind, value in scales.items() if value}

    def only(self, kept: Callable[[FrictionTerm], bool], **changes: str) -> "Friction":
        """Return the actuation with some of its terms."""
        left_out = [FRICTION_TERMS[kind] for kind in self.parts if not kept(FRICTION_TERMS[kind])]
        without: dict[str, Any] = {term.kind: None if term.scale else False for term in left_out}
        return replace(self, **without, **changes)


@dataclass(frozen=True, eq=False)
class MotorInertia(Effect):
    """Inertia of a rotor that turns with c . qdd [kg m2 or kg]."""


@dataclass(frozen=True)
class LeverSpring:
    """A straight spring from a fixed anchor to the end of a lever that turns by t = angle + c . q.

    Its length is l = sqrt(r^2 + h^2 - 2 r h cos t), its torque on t is stiffness r h sin(t) / l (l - rest).
    """

    __pydantic_config__ = file_keys(arm="arm_m", anchor="anchor_m", rest="rest_length_m")

    arm: Positive  # [m] r, length of the lever
    anchor: Positive  # [m] h, from the lever's axis to the anchor
    rest: Positive  # [m] length without force
    angle_deg: float

    @property
    def angle(self) -> float:
        """Where c . q is zero, t [rad]."""
        return float(np.deg2rad(self.angle_deg))


@dataclass(frozen=True, eq=False)
class Spring(Effect):
    """A spring on c . q: linear, the torque stiffness * (c . q), or on a lever."""

    lever: LeverSpring | None = None


@dataclass(frozen=True, eq=False)
class KnownTorque(Effect):
    """A load that is known beforehand, such as a cable's: tau = along * polynomial(c . q)."""

    __pydantic_config__ = file_keys(combination="of", along="on")

    along: Combination
    polynomial: Row  # (k,) high power first [Nm or N]


@dataclass(frozen=True)
class SignalFilter:
    """Filter for recordings of this robot: zero-phase Butterworth, ends cut."""

    __pydantic_config__ = IN_FILES

    order: Annotated[int, Field(ge=1, le=10)]  # of one pass; the filter goes forth and back
    cutoff_hz: Positive
    cut_time_constants: Annotated[float, Field(ge=0.0)] = 5.0  # mirrored beyond either end, and left out within it

    @property
    def cut_s(self) -> float:
        """What is left out at either end [s]; by five constants of its slowest pole it fades to exp(-5), < 1 %."""
        slowest = 2.0 * np.pi * self.cutoff_hz * np.sin(0.5 * np.pi / self.order)
        return float(self.cut_time_constants / slowest)


@dataclass(frozen=True, eq=False)
class Actuation:
    """What loads the joints besides the links, with this robot's defaults for identification."""

    __pydantic_config__ = file_keys(springs="spring", known_torques="known_torque")

    friction: tuple[Friction, ...] = ()
    motor_inertia: tuple[MotorInertia, ...] = ()
    springs: tuple[Spring, ...] = ()
    known_torques: tuple[KnownTorque, ...] = ()
    filter: SignalFilter = SignalFilter(order=4, cutoff_hz=10.0)
    weighting: Weighting = "range"
    coulomb_velocity: Annotated[float, Field(ge=0.0)] = 0.0  # [rad/s or m/s] v0 of tanh(v / v0); sign at 0
    find_rotors: bool = False  # beside those here: one on each joint without
    effort_scale: Row | None = None  # (n,) [Nm or N per unit] of recordings that hold raw efforts
    # (k,) SI, numbers of `actuation_terms`, where they are known: of an identified robot
    values: Row | None = None

    def __post_init__(self) -> None:
        for key in ("effort_scale", "values"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, frozen(getattr(self, key)))

    @property
    def terms(self) -> tuple[Effect, ...]:
        """Every effect."""
        return (*self.friction, *self.motor_inertia, *self.springs, *self.known_torques)

    def moves(self, coordinate: int) -> bool:
        """Return True if any effect acts on a coordinate."""
        return any(term.combination[coordinate] != 0.0 for term in self.terms)


class JointDrives(NamedTuple):
    """Friction and rotor of each joint, zero if unknown."""

    friction: Floats  # (n,) Coulomb [Nm or N]
    damping: Floats  # (n,) viscous [Nms/rad or Ns/m]
    armature: Floats  # (n,) rotors [kg m2 or kg]
    left_out: tuple[str, ...]  # effects that are none of these, by kind and name


class ActuationTerm(NamedTuple):
    """One parameter beside those of the links."""

    kind: str  # of `FRICTION_TERMS`, "motor_inertia" or "spring"
    name: str  # of the friction, rotor or spring
    combination: Floats  # (n,)
    lever: LeverSpring | None = None
    scale: float = 0.0  # of a friction that has one
    recording: str = ""  # that alone has it

    @property
    def friction(self) -> FrictionTerm | None:
        """The term of friction that it is; None for rotors and springs, the loads that friction can grow with."""
        return FRICTION_TERMS.get(self.kind)

    @property
    def grows_with_load(self) -> bool:
        """Whether it is friction that grows with what links, rotors and springs ask."""
        return self.friction is not None and self.friction.grows_with_load


def actuation_terms(actuation: Actuation, *, static: bool = False) -> tuple[ActuationTerm, ...]:
    """Return the terms of a robot's actuation, in the order of the regressor's columns.

    Args:
        actuation: Friction, motors' inertia and springs.
        static: Whether only terms that act at rest are wanted.
    """
    terms = [
        ActuationTerm(kind, friction.name, friction.combination, None, scale, friction.recording)
        for friction in actuation.friction
        for kind, scale in friction.parts.items()
        if FRICTION_TERMS[kind].at_rest or not static
    ]
    if not static:
        terms += [ActuationTerm("motor_inertia", m.name, m.combination) for m in actuation.motor_inertia]
    return (*terms, *(ActuationTerm("spring", s.name, s.combination, s.lever) for s in actuation.springs))


def default_actuation(joint_names: Sequence[str]) -> Actuation:
    """Return friction and a constant on every coordinate, as assumed of a robot whose file says nothing."""
    rows = zip(joint_names, np.eye(len(joint_names)), strict=True)
    return Actuation(friction=tuple(Friction(*row) for row in rows), find_rotors=True)


class StatedDrive(NamedTuple):
    """What a description states of a joint's drive, SI; the joint moves by `factor` times a coordinate."""

    coordinate: str
    factor: float = 1.0
    friction: float = 0.0  # Coulomb [Nm or N]
    damping: float = 0.0  # viscous [Nms/rad or Ns/m]
    armature: float = 0.0  # rotor, as seen at the joint [kg m2 or kg]
    stiffness: float = 0.0  # of a spring [Nm/rad or N/m]
    relaxed: float = 0.0  # the joint's place where the spring asks nothing [rad or m]


def stated_actuation(joint_names: Sequence[str], drives: Sequence[StatedDrive]) -> Actuation | None:
    """Return friction, rotors and springs with the numbers that a description states; None if it states none.

    Coordinates of which nothing is stated have friction of zero, as everywhere to be identified. Joints that move by c
    times a coordinate load it with |c| of their Coulomb friction and c^2 of their damping, rotor and stiffness.
    """
    friction, damping, armature, stiffness, offset = np.zeros((5, len(joint_names)))
    for drive in drives:
        k = joint_names.index(drive.coordinate)
        friction[k] += abs(drive.factor) * drive.friction
        damping[k] += drive.factor**2 * drive.damping
        armature[k] += drive.factor**2 * drive.armature
        stiffness[k] += drive.factor**2 * drive.stiffness
        offset[k] -= drive.factor * drive.stiffness * drive.relaxed
    if not np.any([friction, damping, armature, stiffness]):
        return None
    rows = list(zip(joint_names, np.eye(len(joint_names)), strict=True))
    turning, sprung = np.flatnonzero(armature).tolist(), np.flatnonzero(stiffness).tolist()
    of_joints = np.column_stack([friction, damping, offset]).ravel()
    return replace(
        default_actuation(joint_names),
        motor_inertia=tuple(MotorInertia(*rows[k]) for k in turning),
        springs=tuple(Spring(*rows[k]) for k in sprung),
        values=np.concatenate([of_joints, armature[turning], stiffness[sprung]]),
    )


def joint_drives(actuation: Actuation, n: int) -> JointDrives | None:
    """Return Coulomb friction, viscous friction and rotor inertia of the joints.

    Presliding friction counts as in steady sliding. Terms of several joints, and friction of other kinds, are left out
    and listed.

    Args:
        actuation: What loads the robot's joints.
        n: Number of joints.

    Returns:
        The drives, (n,) each; None if no values are known.
    """
    if actuation.values is None:
        return None
    drives = {drive: np.zeros(n) for drive in ("friction", "damping", "armature")}
    left_out = [f"known torque {known.name}" for known in actuation.known_torques]
    for term, value in zip(actuation_terms(actuation), actuation.values, strict=True):
        moved = np.flatnonzero(term.combination)
        i, factor = int(moved[0]), abs(float(term.combination[moved[0]]))
        drive = {"motor_inertia": "armature"}.get(term.kind, "") if term.friction is None else term.friction.drive
        if len(moved) == 1 and drive:
            drives[drive][i] += (factor if drive == "friction" else factor**2) * value
        elif len(moved) > 1 or value != 0.0:
            left_out.append(f"{term.kind} {term.name}")
    # a solver's zero may lie a rounding below
    return JointDrives(**{key: np.maximum(v, 0.0) for key, v in drives.items()}, left_out=tuple(left_out))


def check_actuation(where: str, actuation: Actuation, n: int) -> None:
    """Refuse effects that do not fit the robot."""
    for kind in ("friction", "motor_inertia", "springs", "known_torques"):
        label, terms = f"{where}: {kind.replace('_', ' ')}", getattr(actuation, kind)
        names = [term.name for term in terms]
        check_names(label, names)
        for term in terms:
            what = f'{label} "{term.name}"'
            if names.count(term.name) > 1:
                raise InputError(f"{what}: is there twice")
            if term.combination.shape != (n,) or not np.isfinite(term.combination).all():
                raise InputError(f"{what}: expected {n} finite factors, got {term.combination}")
            check_within(f"{what}: factor", term.combination, MAX_FACTOR, "")
            along = getattr(term, "along", None)
            if along is not None and (along.shape != (n,) or not np.isfinite(along).all()):
                raise InputError(f"{what}: expected {n} finite factors along which it acts, got {along}")
            if not term.combination.any():
                raise InputError(f"{what}: acts on no coordinate")
            if (lever := getattr(term, "lever", None)) is not None:
                if not 0.0 < lever.arm < lever.anchor:
                    raise InputError(f"{what}: expected an arm above 0 and shorter than the anchor's distance")
                check_within(f"{what}: lever", [lever.anchor, lever.rest, lever.angle], MAX_LENGTH_M, "m or rad")
    if actuation.values is not None:
        count = len(actuation_terms(actuation))
        if actuation.values.shape != (count,) or not np.isfinite(actuation.values).all():
            raise InputError(f"{where}: values: expected {count} finite numbers, got {actuation.values}")
    if actuation.effort_scale is not None and actuation.effort_scale.shape != (n,):
        raise InputError(f"{where}: effort scale: expected {n} factors, got {len(actuation.effort_scale)}")
