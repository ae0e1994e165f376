"""Options of an identification, with defaults from the robot's file."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.config import IN_FILES
from catenary.errors import InputError
from catenary.robots.actuation import MotorInertia, SignalFilter, Weighting
from catenary.robots.friction_terms import FRICTION_PARTS
from catenary.robots.model import RobotModel
from catenary.robots.submodels import BASE_JOINTS
from catenary.spatial import LEVEL

Terms = Literal["full", "static"]
_NOMINAL_GRAVITY: tuple[float, float, float] = tuple(LEVEL.tolist())  # [m/s2]


@dataclass(frozen=True)
class IdentifyOptions:
    """Options; None stands for what the robot's file says."""

    __pydantic_config__ = IN_FILES

    terms: Terms = "full"  # full dynamics, or poses at rest: gravity, constants and springs
    gravity: tuple[float, float, float] = _NOMINAL_GRAVITY  # [m/s2] in base axes
    base_sensor: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] in base axes: where recorded gravity was felt
    cutoff_hz: float | None = None
    weighting: Weighting | None = None
    consistent: bool = True  # only parameters that bodies and friction can have
    friction: tuple[str, ...] = FRICTION_PARTS  # parts that held-out blocks may add to that of the robot's file
    find_rotors: bool = True  # one a joint, beside those of the robot's file
    rotors: tuple[float, ...] | None = None  # (n,) [kg m2 or kg] as known, in place of those
    prior: bool = True  # towards the masses of the robot's file, where it has any and the fit is consistent
    blocks: float | None = None  # [s, or rows at rest] hold out every second block of this length
    seed: Annotated[int, Field(ge=0)] = 0  # of the random motion that the base parameters are found with

    def __post_init__(self) -> None:
        if self.terms not in get_args(Terms):
            raise InputError(f'terms "{self.terms}": expected {" or ".join(get_args(Terms))}')
        if self.weighting is not None and self.weighting not in get_args(Weighting):
            raise InputError(f'weighting "{self.weighting}": expected {", ".join(get_args(Weighting))}')
        unknown = [part for part in self.friction if part not in FRICTION_PARTS]
        if unknown:
            raise InputError(f'friction "{unknown[0]}": expected some of {", ".join(FRICTION_PARTS)}, or none')
        for value in self.rotors or ():
            if not 0.0 <= value < np.inf:
                raise InputError(f"rotors: expected numbers of zero or more, got {value}")
        for name in ("cutoff_hz", "blocks"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise InputError(f"{name}: expected a number above zero, got {value}")


def known_rotors(model: RobotModel, options: IdentifyOptions) -> Floats:
    """Return rotors (n,) [kg m2 or kg] that the options state, zero where they state none."""
    if options.rotors is None or options.terms == "static":
        return np.zeros(model.n)
    if len(options.rotors) != model.n:
        raise InputError(
            f"rotors: expected {model.n} numbers, for {', '.join(model.joint_names)}, got {len(options.rotors)}"
        )
    return np.array(options.rotors)


def rotors_beside(model: RobotModel) -> tuple[MotorInertia, ...]:
    """Return a rotor for every joint without one; none if the robot's table does not ask for them."""
    if not model.assumed_actuation.find_rotors:
        return ()
    own, rows = model.assumed_actuation.motor_inertia, np.eye(model.n)
    return tuple(
        MotorInertia(name, row)
        for i, (name, row) in enumerate(zip(model.joint_names, rows, strict=True))
        if name not in BASE_JOINTS and not any(rotor.combination[i] for rotor in own)
    )


def filter_of(model: RobotModel, options: IdentifyOptions) -> SignalFilter:
    """Return the signal filter of an identification: of the options, else of the robot's file.

    Args:
        model, options: The robot, and options of the identification.
    """
    used = model.assumed_actuation.filter
    return used if options.cutoff_hz is None else replace(used, cutoff_hz=options.cutoff_hz)
