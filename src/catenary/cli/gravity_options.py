"""Options of the gravity source: a ROS topic, or samples of a sensor on the base."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli.options import Names, Triple, group, numbers, option, values_of
from catenary.errors import InputError
from catenary.sensing.fallback_kinds import FALLBACKS
from catenary.sensing.platforms import BASES

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.sensing.gravity_vector import Convention, Mailbox
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.mounting import Mounting
    from catenary.spatial import Pose


def base_tilt(text: str) -> tuple[float, float]:
    """Read roll and pitch of a base [deg]."""
    angles = numbers(text)
    if len(angles) != 2 or not all(map(math.isfinite, angles)):
        raise typer.BadParameter(f"expected roll and pitch in degrees, as 0,20; got {text!r}")
    return angles[0], angles[1]


LEVEL_BASE = (0.0, 0.0)  # roll and pitch [deg]
BASE_TILT = option("R,P", "Turn the base by R about x, then by P about its own y.", read=base_tilt)
GRAVITY = option("X,Y,Z", "Gravity vector in base axes, z up, in m/s2. [default: 0,0,-9.81]")
MOUNTING_FILE = option("FILE", "Sensor's mounting file.")
_SI = ("port", "simulated")  # sensors whose numbers come in SI


@group
class StatedGravity:
    """Options that say which way gravity points in an arm's base at rest; down on a level one without any."""

    vector: Triple | None = replace(GRAVITY, flag="--gravity", not_with=("base_tilt_deg", "imu_reading"))
    imu_reading: Triple | None = option(
        "AX,AY,AZ", "Instead of --gravity: accelerometer's reading on the base at rest, m/s2.", not_with="base_tilt_deg"
    )

    def stated(self, mounting: "Mounting | None" = None) -> "Floats":
        """Return gravity, (3,) in base axes [m/s2]; a reading is corrected and turned by the sensor's mounting."""
        from catenary.arrays import as_array
        from catenary.sensing.gravity_vector import Kind
        from catenary.sensing.mounting import Mounting
        from catenary.spatial import LEVEL

        if self.imu_reading is not None:
            reading = as_array("--imu-reading", self.imu_reading, (3,))
            return (mounting or Mounting()).gravity(reading, Kind.SPECIFIC_FORCE)
        return LEVEL if self.vector is None else as_array("gravity", self.vector, (3,))


@group
class GravityOptions(StatedGravity):
    """The same by the base's tilt too, and by a sensor's place on the robot."""

    base_tilt_deg: tuple[float, float] | None = BASE_TILT
    mounting: Path | None = replace(MOUNTING_FILE, goes_with="imu_reading")
    imu_frame: str | None = option(
        "FRAME", "Frame of the sensor in the robot's description.", goes_with="imu_reading", not_with="mounting"
    )

    def gravity_of(self, model: "catenary.RobotModel") -> "Floats":
        """Return gravity, (3,) in axes of a robot's base [m/s2]."""
        from catenary.sensing.gravity_vector import tilted_gravity
        from catenary.sensing.mounting import Mounting, load_mounting

        if self.base_tilt_deg is not None:
            return tilted_gravity(*map(math.radians, self.base_tilt_deg))
        mounting = Mounting() if self.mounting is None else load_mounting(self.mounting).in_base_of(model)
        return self.stated(mounting if self.imu_frame is None else mounting.at(model, self.imu_frame))

    def doubts(self, gravity: "Floats") -> list[str]:
        """Return in words why this gravity may not be the one that was meant."""
        from catenary.robots.plausibility import gravity_doubts

        return gravity_doubts(gravity, hanging=self.base_tilt_deg is not None)


@group
class ReadingOptions:
    """Options that say how a sensor's numbers come, and where it is fixed to a robot."""

    # a board says its own units, which would be converted twice; a simulated sensor is in SI, in axes as ours
    units: Names | None = option(
        "U[,U]", "Units of accelerometer (m/s2, cm/s2, g, mg) and gyroscope (rad/s, deg/s).", not_with=_SI
    )
    axes: Names | None = option(
        "FRAME|X,Y,Z", "Axes of both: flu, frd, ned, enu, optical, or e.g. x,-y,-z (or six).", not_with="simulated"
    )
    driver: str | None = option(
        "NAME", "Common driver, which sets --units and --axes (list: docs/gravity-vector.md).", not_with=_SI
    )
    imu_frame: str | None = option(
        "ROBOT:FRAME|tf:BASE:FRAME", "Frame of the sensor in a robot's description or on /tf.", not_with="mounting"
    )

    def convention(self) -> "Convention | None":
        """Return the factor on readings; None if none is stated."""
        from catenary.sensing.gravity_vector import convention_of

        if not (self.units or self.axes or self.driver):
            return None
        words = self.axes or ()
        frames = words if len(words) <= 2 else [",".join(words[k : k + 3]) for k in range(0, len(words), 3)]
        return convention_of(self.units or (), frames, self.driver)

    @property
    def has_units(self) -> bool:
        """Units are said."""
        return bool(self.units or self.driver)

    def mounted(self, mounting: "Mounting", by_tf: "Callable[[str, str], Pose] | None" = None) -> "Mounting":
        """Return a mounting, placed and turned as the robot's description, or /tf, has the sensor's frame."""
        if self.imu_frame is None:
            return mounting
        if self.imu_frame.startswith("tf:"):
            _, *frames = self.imu_frame.split(":")
            if len(frames) != 2 or by_tf is None:
                raise InputError(
                    f'--imu-frame "{self.imu_frame}": expected tf:BASE:FRAME, as tf:base_link:imu_link, with a bag to '
                    "--replay or a topic of gravity-node"
                )
            rotation, position = by_tf(*frames)
            return replace(mounting, rotation=rotation, position=position, base=frames[0])
        robot, colon, name = self.imu_frame.rpartition(":")
        if not colon:
            raise InputError(f'--imu-frame "{self.imu_frame}": expected ROBOT:FRAME, as arm.urdf:imu_link')
        return mounting.at(catenary.load_robot(robot), name)


GRAVITY_TOPIC = option(
    "TOPIC", "With --ros: gravity of `catenary gravity-node`, as /gravity. [default: nominal]", goes_with="ros"
)


@group
class SensingOptions:
    """Options of every command that turns samples of a sensor into gravity."""

    mounting_on: str = option("|".join(BASES), "Platform type: sets fault thresholds and settling times.", "table")
    sensor_noise: float | None = option("M/S2", "Noise of an axis of a simulated sensor. [default: 0.04]", min=0.0)
    hanging: bool = option(None, "The base may hang upside down.", False)
    fallback: str = option(
        "|".join(FALLBACKS), f"When samples stop, gravity: {'; '.join(map(str, FALLBACKS.values()))}.", "fade"
    )
    stale_after: float = option("S", "Age from which the newest sample is stale.", 0.05)
    age_limit: float = option("S", "Age from which the fallback acts.", 0.2)
    attitude_time: float | None = option("S", "Averaging time of the direction of fade. [default: by --mounting-on]")
    start_limit: float = option("S", "With --fallback stop: stop if no valid sample arrives by then.", 1.0)

    def as_data(self) -> dict[str, Any]:
        """Return the given options as plain data."""
        defaults = SensingOptions()
        return {name: value for name, value in vars(self).items() if value != getattr(defaults, name)}

    def source(
        self, mailbox: "Mailbox", mounting: "Mounting", *, angular: bool, feed: Callable[[float], None] | None = None
    ) -> "SensedGravity":
        """Return the source of gravity that reads a mailbox so."""
        from catenary.sensing.imu import SensedGravity

        options = values_of(self, "fallback", "hanging", "stale_after", "age_limit", "attitude_time", "start_limit")
        return SensedGravity(mailbox, mounting, mounted_on=self.mounting_on, angular=angular, feed=feed, **options)
