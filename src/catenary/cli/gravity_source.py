"""Where gravity beside a robot on ROS comes from: a gravity node, or an Imu on the base."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.latest import ImuTopic

GravityTopicName = Annotated[
    str | None,
    typer.Option(
        "--gravity",
        metavar="TOPIC",
        help="With --ros: gravity as `catenary gravity-node` publishes it, as /gravity.",
    ),
]
ImuTopicName = Annotated[
    str | None,
    typer.Option(
        "--imu", metavar="TOPIC", help="With --ros, in its place: a sensor_msgs/Imu, as /imu/data_raw."
    ),
]


def gravity_source(
    ros: int | None, gravity: str | None, imu: str | None, mounting: Path | None
) -> "ImuTopic | None":
    """Say where gravity comes from; None for nominal gravity.

    Raises:
        InputError: Options that do not go together.
        ConfigError: A mounting file that is none.
    """
    if ros is None and (gravity is not None or imu is not None or mounting is not None):
        raise InputError("--gravity, --imu and --mounting go with --ros; a simulated robot knows its gravity")
    if gravity is not None and imu is not None:
        raise InputError("give one of --gravity and --imu")
    if mounting is not None and imu is None:
        raise InputError("--mounting goes with --imu; a gravity node has turned what it publishes already")
    if gravity is None and imu is None:
        return None
    from catenary.crtk.latest import ImuTopic, published_gravity
    from catenary.sensing.mounting import Mounting, load_mounting

    if gravity is not None:
        return published_gravity(gravity)
    return ImuTopic(imu or "", mounting=Mounting() if mounting is None else load_mounting(mounting))
