"""Where gravity comes from: a topic beside a robot on ROS, or samples of a sensor on the base."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from catenary.cli.options import BaseTilt, Hanging, MountingFile
from catenary.cli.terminal import base_tilt, numbers
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.crtk.gravity_topic import ImuTopic
    from catenary.sensing.checks import SensorRules
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.mounting import Mounting
    from catenary.sensing.vector import Mailbox


ImuReading = Annotated[
    str | None,
    Option(
        "--imu-reading",
        metavar="AX,AY,AZ",
        help="In place of --gravity: what an accelerometer on the base reads at rest, up, in m/s2.",
    ),
]


def gravity_of_reading(reading: str, mounting: Path | None = None) -> "Floats":
    """Return gravity (3,) in base axes of what an accelerometer reads, corrected and turned by its mounting file."""
    from catenary.arrays import as_array
    from catenary.sensing.mounting import Mounting, load_mounting
    from catenary.sensing.vector import Kind

    told = Mounting() if mounting is None else load_mounting(mounting)
    force = as_array("--imu-reading", numbers("--imu-reading", reading, 3), (3,))
    return told.gravity(force, Kind.SPECIFIC_FORCE)


@dataclass(frozen=True)
class GivenGravity:
    """Options that say which way gravity points in an arm's base at rest; down on a level one without any."""

    base_tilt_deg: BaseTilt = None
    vector: Annotated[
        str | None,
        Option("--gravity", metavar="X,Y,Z", help="Gravity vector in base axes, z up, in m/s2."),
    ] = None
    imu_reading: ImuReading = None
    mounting: MountingFile = None

    def told(self, command: str) -> "Floats":
        """Return gravity, (3,) in base axes.

        Args:
            command: Which opens what is refused.
        """
        import numpy as np

        from catenary.arrays import as_array
        from catenary.sensing.vector import tilted_gravity
        from catenary.spatial import LEVEL

        if sum(given is not None for given in (self.base_tilt_deg, self.vector, self.imu_reading)) > 1:
            raise InputError(f"{command}: give one of --base-tilt-deg, --gravity and --imu-reading")
        if self.mounting is not None and self.imu_reading is None:
            raise InputError(f"{command}: --mounting corrects --imu-reading; give one")
        if self.imu_reading is not None:
            return gravity_of_reading(self.imu_reading, self.mounting)
        if self.base_tilt_deg is not None:
            roll, pitch = np.deg2rad(base_tilt(self.base_tilt_deg))
            return tilted_gravity(float(roll), float(pitch))
        return (
            LEVEL if self.vector is None else as_array("gravity", numbers("--gravity", self.vector, 3), (3,))
        )

    def doubts(self, gravity: "Floats") -> list[str]:
        """Return in words why this gravity may not be the one that was meant."""
        from catenary.sensing.vector import gravity_doubts

        return gravity_doubts(gravity, hanging=self.base_tilt_deg is not None)


@dataclass(frozen=True)
class RuleOptions:
    """Options that say what of a sensor on a base is believed."""

    mounting_on: Annotated[
        str,
        Option(
            metavar="table|cart|vehicle|ship",
            help="What carries the base: gives rules, cut-off and times that suit how it moves.",
        ),
    ] = "table"
    sensor_noise: Annotated[
        float | None,
        Option(metavar="M/S2", min=0.0, help="Noise of an axis of the sensor at rest. [default: 0.04]"),
    ] = None
    rule: Annotated[
        list[str] | None,
        Option(
            metavar="NAME=VALUE",
            help="A rule of what is believed, as max_push=4; repeatable. docs/gravity-vector.md has all of them.",
        ),
    ] = None
    hanging: Hanging = False

    def rules(self) -> "SensorRules":
        """Return what is believed."""
        from catenary.sensing.bases import CHEAP_NOISE, rules_for

        changes = {"max_tilt": math.pi} if self.hanging else {}
        changes |= dict(_rule(text) for text in self.rule or ())
        noise = CHEAP_NOISE if self.sensor_noise is None else self.sensor_noise
        return rules_for(self.mounting_on, noise=noise, changes=changes)


@dataclass(frozen=True)
class GravityOptions(RuleOptions):
    """Options that say where gravity comes from; nominal gravity without any."""

    gravity: Annotated[
        str | None,
        Option(metavar="TOPIC", help="With --ros: gravity of `catenary gravity-node`, as /gravity."),
    ] = None
    imu: Annotated[
        str | None,
        Option(metavar="TOPIC", help="With --ros, in its place: a sensor_msgs/Imu, as /imu/data_raw."),
    ] = None
    mounting: MountingFile = None

    def source(self, ros: int | None) -> "ImuTopic | None":
        """Return the topic that gravity comes from; None for nominal gravity."""
        if self == GravityOptions():
            return None
        if ros is None:
            raise InputError(
                "--gravity, --imu and options of a sensor go with --ros; a simulated robot knows its own"
            )
        if self.gravity is not None and self.imu is not None:
            raise InputError("give one of --gravity and --imu")
        if self.mounting is not None and self.imu is None:
            raise InputError("--mounting goes with --imu; a gravity node publishes in base axes already")
        if self.imu is None and replace(self, gravity=None) != GravityOptions():
            raise InputError(
                "--mounting-on, --sensor-noise, --rule and --hanging go with --imu; a gravity node has its own"
            )
        from catenary.crtk.gravity_topic import ImuTopic, published_gravity
        from catenary.sensing.mounting import Mounting, load_mounting

        if self.gravity is not None:
            return published_gravity(self.gravity)
        mounting = Mounting() if self.mounting is None else load_mounting(self.mounting)
        return ImuTopic(self.imu or "", mounting=mounting, rules=self.rules())


@dataclass(frozen=True)
class SensingOptions(RuleOptions):
    """Options of every command that turns samples of a sensor into gravity."""

    cutoff_hz: Annotated[
        float | None,
        Option(metavar="HZ", help="Half power of the filter. [default: what suits --mounting-on]"),
    ] = None
    fallback: Annotated[
        str, Option(metavar="hold|fade|static|stop", help="What gravity becomes when samples stop.")
    ] = "fade"
    stale_after: Annotated[
        float, Option(metavar="S", help="Age from which the newest sample counts as held.")
    ] = 0.05
    age_limit: Annotated[float, Option(metavar="S", help="Age from which the fallback acts.")] = 0.2
    attitude_time: Annotated[
        float | None,
        Option(
            metavar="S", help="Average of the direction that fade goes to. [default: suits --mounting-on]"
        ),
    ] = None
    start_limit: Annotated[
        float, Option(metavar="S", help="Without a believed sample for so long, fallback stop stops.")
    ] = 1.0

    def as_data(self) -> dict[str, Any]:
        """Return what was given, as plain data."""
        defaults = SensingOptions()
        return {name: value for name, value in vars(self).items() if value != getattr(defaults, name)}

    def source(
        self,
        mailbox: "Mailbox",
        mounting: "Mounting",
        *,
        angular: bool,
        feed: Callable[[float], None] | None = None,
    ) -> "SensedGravity":
        """Return the source of gravity that reads a mailbox so."""
        from catenary.sensing.imu import SensedGravity

        return SensedGravity(
            mailbox,
            mounting,
            mounted_on=self.mounting_on,
            angular=angular,
            fallback=self.fallback,
            cutoff_hz=self.cutoff_hz,
            stale_after=self.stale_after,
            age_limit=self.age_limit,
            attitude_time=self.attitude_time,
            start_limit=self.start_limit,
            rules=self.rules(),
            feed=feed,
        )


def _rule(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError as error:
        raise InputError(f'--rule "{text}": expected NAME=VALUE with a number, as max_push=4') from error
    key = name.strip().replace("-", "_")
    return key, int(number) if key in ("stuck_samples", "confirm") and number.is_integer() else number
