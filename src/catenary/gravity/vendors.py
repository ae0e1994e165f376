"""Gravity for the compensation of a vendor's own controller: in its signs, and what a level-base one leaves to add."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.robots.model import RobotModel

_MAX_GRAVITY = 30.0  # [m/s2] beyond which a vector is none that a base feels


class Vendor(NamedTuple):
    """A vendor's way to set gravity in its controller."""

    sign: float  # of free-fall acceleration in base axes; 0 where it cannot be set
    command: str  # {} are x, y and z
    limits: str  # what its makers say of it


VENDORS: dict[str, Vendor] = {
    # [Universal Robots, 7th axis gravity settings: (0, 0, 9.82) at rest, (4.91, 0, 9.82) accelerated along x by 0.5 g;
    # its ROS 2 driver's gravity_update_controller: "anti-gravity (away from Earth)", in `base`]
    "ur": Vendor(
        -1.0,
        "set_gravity([{:.4f}, {:.4f}, {:.4f}])",
        "points up, as an accelerometer reads, in axes of its controller's base, half a turn about z of base_link; "
        "in a secondary program (sec ... end) it runs beside another, twice a second; keep the joints still while "
        "the base accelerates",
    ),
    # [Kinova's kortex_api, GravityVector: "in terms of the robot base frame ... defaults to (0, 0, -9.81)"; after each
    # start it must be sent again]
    "kortex": Vendor(
        1.0,
        "control_config.SetGravityVector(ControlConfig_pb2.GravityVector(gravity_x={:.4f}, gravity_y={:.4f}, "
        "gravity_z={:.4f}))",
        "points down; a setting and no stream: the arm at rest, and again after each start",
    ),
    # [libfranka, control_types.h: torques are "without gravity and friction", and O_ddP_O is "hardcoded for now to
    # {0, 0, -9.81}"; franka_ros, issue 327: "You cannot change the gravity vector on the real robot"]
    "franka": Vendor(
        0.0,
        "",
        "its gravity cannot be set: add gravity_delta to the torques of its torque interface, which compensates for a "
        "level base; Model::gravity(state, gravity_earth) takes the vector that points down",
    ),
}


def vendor_of(name: str) -> Vendor:
    """Return a vendor by its name."""
    if name not in VENDORS:
        raise InputError(f'vendor "{name}": expected one of {", ".join(VENDORS)}')
    return VENDORS[name]


def in_controller_base(name: str, base: RobotModel | str, gravity: ArrayLike) -> Floats:
    """Return gravity in a vendor's own base frame; InputError for a base whose relation to it is unknown.

    A Universal Robot's controller uses the frame `base`, half a turn from the `base_link` of its description.

    Args:
        base: Robot whose base frame gravity is in, or the name of that frame.
        gravity: Gravity (3,) [m/s2].
    """
    vector = as_array("gravity", gravity, (3,))
    if isinstance(base, str):
        if name == "ur" and not base.endswith(("base", "base_link")):
            raise InputError(
                f'gravity for {name}: it is in axes of "{base}", expected base or base_link, as by a mounting file or '
                "--imu-frame tf:base:imu_link"
            )
        return vector * [-1.0, -1.0, 1.0] if name == "ur" and base.endswith("base_link") else vector
    own = base.frames.get("base") if name == "ur" else None
    return vector if own is None or own.link >= 0 else vector @ own.pose.rotation


def vendor_command(name: str, gravity: ArrayLike) -> str:
    """Return the command that sets gravity in a vendor's controller; empty if there is none.

    Args:
        gravity: Gravity in the controller's base frame (3,) [m/s2]; not zero, nor above what it takes.
    """
    vendor, vector = vendor_of(name), as_array("gravity", gravity, (3,))
    if not 0.0 < float(np.linalg.norm(vector)) <= _MAX_GRAVITY:
        raise InputError(
            f"gravity for {name}: expected a length of more than 0 and at most {_MAX_GRAVITY:g} m/s2, got {vector}"
        )
    return vendor.command.format(*(vendor.sign * vector + 0.0))
