"""Friction terms (Coulomb, viscous, presliding and more), one record each, with load on a joint and properties.

Robot files, inverse dynamics, compiled code, C, units, bounds, `identify` and its help read `FRICTION_TERMS`. A new
term is a record there, tested by tests/contracts/test_friction_terms.py; CONTRIBUTING.md adds one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING, Any, Literal

from catenary.units import TORQUE_UNIT

if TYPE_CHECKING:
    from catenary.arrays import Floats


@dataclass(frozen=True)
class Sliding:
    """A joint that slides, in numbers, arrays or symbols, with functions of these: `f.abs`, `exp`, `sign`, `tanh`."""

    rate: Any  # v [rad/s or m/s]
    scale: float  # of the term, in its unit; 0 for a term without
    coulomb_velocity: float  # [rad/s or m/s] v0 of tanh(v / v0); sign at 0
    f: Any

    @property
    def direction(self) -> Any:
        """The sign of the rate, or tanh(rate / coulomb_velocity)."""
        if self.coulomb_velocity > 0.0:
            return self.f.tanh(self.rate * (1.0 / self.coulomb_velocity))
        return self.f.sign(self.rate)


@dataclass(frozen=True)
class FrictionScale:
    """A speed or distance on which a term depends other than linearly."""

    key: str  # in robot files
    of: Literal["speed", "travel"]
    shares: tuple[float, ...]  # that `identify` tries: of the rate's RMS, or of the travel between 5 and 95 %


@dataclass(frozen=True)
class FrictionTerm:
    """One term of friction, linear in its coefficient."""

    kind: str
    words: str  # its formula and what it is, for tables
    law: Callable[[Sliding], Any]  # the load per unit of the coefficient, in steady sliding
    speed_power: int = 0  # of the rate in the load, which gives the coefficient's unit
    usual: bool = False  # on every joint, unless a robot's file says false; others are there where it says so
    beside: str = ""  # the usual term that a friction must have for `identify` to try this one
    # rows (factor, other): factor times the coefficient plus that of another term, or none, is zero or more
    bounds: tuple[tuple[float, str], ...] = ()
    scale: FrictionScale | None = None
    grows_with_load: bool = False  # the load is multiplied by what links, rotors and springs ask
    leaps: bool = False  # where the rate changes sign: filtered torques hold the step rounded
    # writes the load (N,) along a path s (N,) by its scale, where it depends on more than the rate; compiled
    memory: "Callable[[Floats, float, Floats], None] | None" = None
    at_rest: bool = False  # whether poses at rest show it
    drive: Literal["friction", "damping", ""] = ""  # what a simulator or a URDF takes it for

    def load(self, rate: Any, scale: float, coulomb_velocity: float, f: Any) -> Any:
        """Return its load per unit at a rate, without what it grows with."""
        return self.law(Sliding(rate, scale, coulomb_velocity, f))

    def unit(self, joint_unit: str) -> str:
        """Return the coefficient's SI unit on a joint in rad or m."""
        if self.grows_with_load:
            return ""
        power = "" if self.speed_power == 1 else str(self.speed_power)
        per_speed = f" s{power}/{joint_unit}{power}" if self.speed_power else ""
        return f"{TORQUE_UNIT[joint_unit]}{per_speed}"

    @property
    def needs_course(self) -> bool:
        """Whether it shows only by speeds, paths or torques that a recording has and drawn motion has not."""
        return self.scale is not None or self.grows_with_load


def _stribeck(sliding: Sliding) -> Any:
    slow = sliding.rate * (1.0 / sliding.scale)
    return sliding.direction * sliding.f.exp(-(slow * slow))


def dahl_path(s: "Floats", distance: float, out: "Floats") -> None:
    """Write Dahl's friction z (N,) along a path s from rest, between -1 and 1: dz = ds - |ds| z / distance, in its
    units.
    """
    z = 0.0
    out[0] = z
    for k in range(1, len(s)):
        step = s[k] - s[k - 1]
        # exact while the direction stays: z goes to the direction's sign as exp(-|ds| / distance)
        towards = 1.0 if step > 0.0 else -1.0
        z = towards + (z - towards) * exp(-abs(step) / distance)
        out[k] = z


NOT_NEGATIVE = ((1.0, ""),)

_TERMS = (  # in the order of their columns
    FrictionTerm(
        "coulomb", "f sign(v)", lambda v: v.direction,
        usual=True, bounds=NOT_NEGATIVE, leaps=True, drive="friction",
    ),
    FrictionTerm(
        "viscous", "b v", lambda v: v.rate,
        speed_power=1, usual=True, bounds=NOT_NEGATIVE, drive="damping",
    ),
    FrictionTerm(
        "offset", "a constant", lambda v: 1.0,
        usual=True, at_rest=True,
    ),
    FrictionTerm(
        "asymmetric",
        "a abs(v): viscous friction that differs by direction (Coulomb friction that does is the constant)",
        lambda v: v.f.abs(v.rate),
        speed_power=1, beside="viscous", bounds=((1.0, "viscous"), (-1.0, "viscous")),
    ),
    # [Armstrong-Helouvry, Dupont, Canudas de Wit, "A survey of models, analysis tools and compensation methods",
    # Automatica 30(7), 1994]; below zero, down to Coulomb friction, it is friction that rises with speed
    FrictionTerm(
        "stribeck", "k sign(v) exp(-(v / v_s)^2), five speeds tried", _stribeck,
        beside="coulomb", bounds=((1.0, "coulomb"),), leaps=True,
        scale=FrictionScale("stribeck_velocity", "speed", (0.05, 0.1, 0.2, 0.4, 0.8)),
    ),
    FrictionTerm(
        "load", "k sign(v) abs(torque of links, rotors, springs)", lambda v: v.direction,
        beside="coulomb", bounds=NOT_NEGATIVE, grows_with_load=True, leaps=True,
    ),
    # [Dahl, "A solid friction model", 1968], as on cables and elastic drives; in steady sliding it is sign(v)
    FrictionTerm(
        "presliding",
        "f z, z' = v - abs(v) z / x_s in units of x_s (Dahl 1968), five distances tried: friction that builds up after "
        "a reversal, as in cables",
        lambda v: v.direction,
        beside="coulomb", bounds=NOT_NEGATIVE, memory=dahl_path, drive="friction",
        scale=FrictionScale("presliding_distance", "travel", (0.001, 0.003, 0.01, 0.03, 0.1)),
    ),
)  # fmt: skip
FRICTION_TERMS = {term.kind: term for term in _TERMS}
# parts that `identify` may add; "recording" stands for the usual terms once more, for each recording
FRICTION_PARTS = (*(term.kind for term in _TERMS if not term.usual), "recording")
