"""The `[actuation]` part of a robot file in TOML."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.config import Settings
from catenary.errors import ConfigError
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    SignalFilter,
    Spring,
    Weighting,
)

Combination = Annotated[dict[str, float], Field(min_length=1)]
Positive = Annotated[float, Field(gt=0.0)]


class EffectTable(Settings):
    """An effect on a combination of coordinates; motor inertia has nothing else to say."""

    name: str
    on: Combination


class FrictionTable(EffectTable):
    """Friction on a combination of coordinates."""

    coulomb: bool = True
    viscous: bool = True
    offset: bool = True
    asymmetric: bool = False
    stribeck_velocity: Positive | None = None  # rad/s or m/s
    load: bool = False
    presliding_distance: Positive | None = None  # rad or m


class LeverTable(Settings):
    """A straight spring at the end of a lever."""

    arm_m: Positive
    anchor_m: Positive
    rest_length_m: Positive
    angle_deg: float


class SpringTable(EffectTable):
    """A spring on a combination of coordinates."""

    lever: LeverTable | None = None


class KnownTorqueTable(EffectTable):
    """A polynomial of one combination, acting along another."""

    of: Combination
    polynomial: Annotated[tuple[float, ...], Field(min_length=1)]  # high power first


class FilterTable(Settings):
    """Defaults for filtering this robot's recordings."""

    order: Annotated[int, Field(ge=1, le=10)]
    cutoff_hz: Positive
    cut_samples: Annotated[int, Field(ge=0)]
    period_samples: Annotated[int, Field(ge=1)] | None = None
    rate_hz: Positive | None = None


class ActuationTable(Settings):
    """What loads the joints beside the links, and how recordings are treated."""

    weighting: Weighting = "range"
    coulomb_velocity: Annotated[float, Field(ge=0.0)] = 0.0  # rad/s or m/s, along the combination
    effort_scale: tuple[float, ...] | None = None  # Nm or N per recorded unit of raw effort
    friction: tuple[FrictionTable, ...] = ()
    motor_inertia: tuple[EffectTable, ...] = ()
    spring: tuple[SpringTable, ...] = ()
    known_torque: tuple[KnownTorqueTable, ...] = ()
    filter: FilterTable | None = None


def read_actuation(path: Path, table: ActuationTable, names: Sequence[str]) -> Actuation:
    """Return the actuation of a robot whose coordinates have these names.

    Raises:
        ConfigError: A term acts on a coordinate that the robot does not have.
    """

    def row(kind: str, effect: EffectTable, factors: Mapping[str, float]) -> Floats:
        unknown = [key for key in factors if key not in names]
        if unknown:
            raise ConfigError(
                f'{path}: actuation: {kind} "{effect.name}": acts on unknown coordinate "{unknown[0]}"; '
                f"coordinates: {', '.join(names)}"
            )
        return np.array([factors.get(key, 0.0) for key in names], dtype=float)

    return Actuation(
        friction=tuple(
            Friction(
                t.name,
                row("friction", t, t.on),
                t.coulomb,
                t.viscous,
                t.offset,
                t.asymmetric,
                t.stribeck_velocity,
                t.load,
                t.presliding_distance,
            )
            for t in table.friction
        ),
        motor_inertia=tuple(MotorInertia(t.name, row("motor_inertia", t, t.on)) for t in table.motor_inertia),
        springs=tuple(Spring(t.name, row("spring", t, t.on), _lever(t.lever)) for t in table.spring),
        known_torques=tuple(
            KnownTorque(
                t.name, row("known_torque", t, t.of), row("known_torque", t, t.on), np.array(t.polynomial)
            )
            for t in table.known_torque
        ),
        filter=SignalFilter() if table.filter is None else SignalFilter(**table.filter.model_dump()),
        weighting=table.weighting,
        coulomb_velocity=table.coulomb_velocity,
        effort_scale=None if table.effort_scale is None else np.array(table.effort_scale),
    )


def _lever(table: LeverTable | None) -> LeverSpring | None:
    if table is None:
        return None
    return LeverSpring(table.arm_m, table.anchor_m, table.rest_length_m, float(np.deg2rad(table.angle_deg)))
