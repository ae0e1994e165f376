"""Which robot the operator's commands move: their options, and the robot, opened for as long as a command runs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from typer import Option

from catenary.cli import beside_robot
from catenary.cli.options import NodeName, robots_beginning
from catenary.cli.terminal import base_tilt, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.gravity_topic import ImuTopic
    from catenary.workflows.robot.operated_robot import OperatedRobot


@dataclass(frozen=True)
class WatchedRobot:
    """Options of a robot that is only read: which, and where it is."""

    robot: Annotated[
        str,
        Option(
            metavar="ROBOT",
            help="raven2, raven2_right, another of the catalogue, or a robot file.",
            autocompletion=robots_beginning,
        ),
    ] = "raven2"
    ros: Annotated[
        int | None, Option(metavar="1|2", help="The robot is on ROS 1 or 2. [default: simulated here]")
    ] = None
    dialect: Annotated[str | None, Option(help="With --ros: raven or crtk. [default: the robot's own]")] = (
        None
    )
    namespace: Annotated[
        str | None, Option(metavar="/NAME", help="With --dialect crtk: in front of its verbs.")
    ] = None
    name: NodeName = None
    simulated: Annotated[
        bool,
        Option("--simulated", help="With --ros: that robot is simulated, so there is no workspace to clear."),
    ] = False
    base_tilt_deg: Annotated[
        str | None, Option(metavar="R,P", help="Simulated: roll about x, then pitch about y, of its base.")
    ] = None
    robot_seed: Annotated[
        int | None,
        Option(help="Simulated: another RAVEN-II, drawn with this seed. [default: the nominal one]"),
    ] = None


@dataclass(frozen=True)
class MovedRobot(WatchedRobot):
    """Options of a robot that is moved."""

    yes: Annotated[bool, Option("--yes", help="With --ros: the workspace is clear; do not ask.")] = False


@dataclass(frozen=True)
class PacedRobot(MovedRobot):
    """Options of a robot that is moved by itself, for which simulated time may run faster."""

    fast: Annotated[
        bool, Option("--fast", help="Simulated: as fast as the machine allows, not in real time.")
    ] = False


@contextmanager
def open_robot(
    chosen: WatchedRobot,
    command: str,
    *,
    moves: bool = True,
    homed: bool = True,
    imu: "ImuTopic | None" = None,
) -> "Iterator[OperatedRobot]":
    """Open a robot for a command: simulated in this process, enabled and homed, or one on ROS, as it is."""
    from catenary.crtk.client import CrtkClient
    from catenary.crtk.network import node_name
    from catenary.crtk.reader import CrtkReader
    from catenary.open_robot import OverTopics, Simulated, tilted_base
    from catenary.workflows.robot.homing import clear_workspace
    from catenary.workflows.robot.operated_robot import operated_robot

    robot, tilt, seed, simulated = chosen.robot, chosen.base_tilt_deg, chosen.robot_seed, chosen.simulated
    yes = isinstance(chosen, MovedRobot) and chosen.yes
    fast = isinstance(chosen, PacedRobot) and chosen.fast
    if chosen.ros is None:
        named = chosen.namespace is not None or chosen.name is not None
        if named or simulated or yes or chosen.dialect is not None:
            raise InputError(
                "--dialect, --namespace, --name, --simulated and --yes go with --ros; this robot is simulated here"
            )
        where = Simulated(seed, tilted_base(base_tilt(tilt)), homed=homed)
        yield operated_robot(robot, where, real_time=not fast)
        return
    if tilt is not None or seed is not None or fast:
        raise InputError("--base-tilt-deg, --robot-seed and --fast go with a simulated robot, not with --ros")
    with beside_robot.ros_transport(chosen.ros, node_name(command, chosen.name)) as transport:
        is_read = not isinstance(chosen, MovedRobot)
        there = OverTopics(transport, chosen.dialect, chosen.namespace, simulated, imu, only_read=is_read)
        opened = operated_robot(robot, there)
        client = cast(CrtkReader, opened.plant)
        with client:
            if moves and not simulated and not yes:
                clear_workspace(beside_robot.TerminalGuide())
            if isinstance(client, CrtkClient):
                client.require_free()
            yield opened


@contextmanager
def recorded(robot: "OperatedRobot", folder: Path | None) -> "Iterator[Callable[[], str | None]]":
    """Record a robot while it is used, into a folder or not at all; yields what to call after each tick."""
    if folder is None:
        yield lambda: None
        return
    from catenary.workflows.robot.topic_recorder import BesideRecorder

    recorder = BesideRecorder(robot, folder)
    try:
        yield recorder.observe
    finally:
        print_notes([recorder.close()])
