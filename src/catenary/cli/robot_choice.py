"""Robots that commands move or read: which one, on which ROS or simulated here, and its operator."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE
from catenary.cli.options import group, option
from catenary.cli.terminal import announce

if TYPE_CHECKING:
    from catenary.workflows.robot.operated_robot import OperatedRobot

NODE_NAME = option("NAME", "Name of this program's ROS node. [default: catenary_COMMAND_PID]")
CARRIER = option("1|2|none", "ROS version that carries the messages.", "1", joins_ros=True)
BAUD = option(None, "Speed of the serial line.", 115200, least=300)
DIALECT = option("raven|crtk", "With --ros: dialect of its topics. [default: the robot's own]", goes_with="ros")
NAMESPACE = option("/NAME", "With --dialect crtk: namespace of the robot's topics.", goes_with="ros")
SIMULATED_SEED = option("N", "Simulate another robot of the kind. [default: the nominal one]", least=0)


@group
class RobotPlace:
    """Options of where a robot is: on ROS, or simulated here."""

    ros: int | None = option("1|2", "The robot is on ROS 1 or 2. [default: simulated here]", joins_ros=True)
    dialect: str | None = DIALECT
    namespace: str | None = NAMESPACE
    name: str | None = replace(NODE_NAME, goes_with="ros")
    simulated: bool = option(None, "With --ros: the robot is simulated; no workspace to clear.", False, goes_with="ros")
    robot_seed: int | None = replace(SIMULATED_SEED, not_with="ros")


@group
class WatchedRobot(RobotPlace):
    """Options of a robot that is only read: which, and where it is."""

    robot: str = option("ROBOT", "raven2, raven2_right, another of the catalogue, or a robot file.", "raven2")
    base_tilt_deg: tuple[float, float] | None = replace(BASE_TILT, not_with="ros")


@group
class MovedRobot(WatchedRobot):
    """Options of a robot that is moved."""

    yes: bool = option(None, "With --ros: the workspace is clear; do not ask.", False, goes_with="ros")


@group
class PacedRobot(MovedRobot):
    """Options of a robot that is moved by itself, for which simulated time may run faster."""

    fast: bool = option(None, "Simulated: as fast as the machine allows, not in real time.", False, not_with="ros")


class TerminalGuide:
    """Asks in the terminal; Enter confirms, q cancels."""

    def say(self, text: str) -> None:
        """Show a message."""
        announce(text)

    def confirm(self, text: str) -> bool:
        """Wait for Enter."""
        print(f"{text}\n  [Enter] done   [q] cancel: ", end="", file=sys.stderr, flush=True)
        answer = sys.stdin.readline()
        return answer != "" and answer.strip().lower() not in ("q", "quit", "n", "no")


@contextmanager
def chosen_robot(
    chosen: WatchedRobot, command: str, *, moves: bool = True, homed: bool = True, gravity: str | None = None
) -> "Iterator[OperatedRobot]":
    """Open a robot for a command: simulated in this process, enabled and homed, or one on ROS, as it is."""
    from catenary.crtk.client import CrtkClient
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.reader import CrtkReader
    from catenary.open_robot import OverTopics, Simulated, tilted_base
    from catenary.workflows.robot.homing import clear_workspace
    from catenary.workflows.robot.operated_robot import operated_robot

    robot, simulated = chosen.robot, chosen.simulated
    if chosen.ros is None:
        where = Simulated(chosen.robot_seed, tilted_base(chosen.base_tilt_deg or LEVEL_BASE), homed=homed)
        yield operated_robot(robot, where, real_time=not (isinstance(chosen, PacedRobot) and chosen.fast))
        return
    asks = not simulated and not (isinstance(chosen, MovedRobot) and chosen.yes)
    with make_transport(str(chosen.ros), node_name(command, chosen.name)) as transport:
        is_read = not isinstance(chosen, MovedRobot)
        there = OverTopics(transport, chosen.dialect, chosen.namespace, simulated, gravity, only_read=is_read)
        opened = operated_robot(robot, there)
        client = cast(CrtkReader, opened.plant)
        with client:
            if moves and asks:
                clear_workspace(TerminalGuide())
            if isinstance(client, CrtkClient):
                client.require_free()
            yield opened
