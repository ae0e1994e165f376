"""Where gravity beside a robot on ROS comes from: a gravity node, or an Imu on the base."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.options import MountingFile
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.latest import ImuTopic


@dataclass(frozen=True)
class GravityOptions:
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
        """Return the topic that gravity comes from; None for nominal gravity.

        Raises:
            InputError: Options that do not go together.
            ConfigError: A mounting file that is none.
        """
        if self == GravityOptions():
            return None
        if ros is None:
            raise InputError("--gravity, --imu and --mounting go with --ros; a simulated robot knows its own")
        if self.gravity is not None and self.imu is not None:
            raise InputError("give one of --gravity and --imu")
        if self.mounting is not None and self.imu is None:
            raise InputError("--mounting goes with --imu; a gravity node publishes in base axes already")
        from catenary.crtk.latest import ImuTopic, published_gravity
        from catenary.sensing.mounting import Mounting, load_mounting

        if self.gravity is not None:
            return published_gravity(self.gravity)
        mounting = Mounting() if self.mounting is None else load_mounting(self.mounting)
        return ImuTopic(self.imu or "", mounting=mounting)
