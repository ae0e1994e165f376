"""Which robot the operator's commands move: their options, and the robot, opened for as long as a command runs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catenary.cli.beside_robot import TerminalGuide, ros_transport
from catenary.cli.terminal import print_notes, roll_and_pitch
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.latest import ImuTopic
    from catenary.workflows.robot.operated_robot import OperatedRobot

RobotName = Annotated[
    str,
    typer.Option(
        "--robot", metavar="ROBOT", help="raven2, raven2_right, another of the catalogue, or a robot file."
    ),
]
OnRos = Annotated[
    int | None, typer.Option("--ros", metavar="1|2", help="It is on ROS 1 or 2. [default: simulated here]")
]
DialectName = Annotated[str, typer.Option("--dialect", help="With --ros: raven or crtk.")]
Namespace = Annotated[
    str | None,
    typer.Option("--namespace", metavar="/NAME", help="With --dialect crtk: in front of its verbs."),
]
IsSimulated = Annotated[
    bool,
    typer.Option(
        "--simulated", help="With --ros: the robot there is a simulation, and no workspace to clear."
    ),
]
Yes = Annotated[bool, typer.Option("--yes", help="With --ros: the workspace is clear; ask nobody.")]
Tilt = Annotated[
    str | None,
    typer.Option(
        "--base-tilt-deg", metavar="R,P", help="Simulated: roll about x, then pitch about y, of its base."
    ),
]
RobotSeed = Annotated[
    int | None,
    typer.Option("--robot-seed", help="Simulated: draws another RAVEN-II. [default: the nominal one]"),
]
Fast = Annotated[
    bool, typer.Option("--fast", help="Simulated: as fast as the machine allows, not in real time.")
]


@contextmanager
def open_robot(
    robot: str,
    ros: int | None,
    *,
    dialect: str = "raven",
    namespace: str | None = None,
    simulated: bool = False,
    moves: bool = True,
    yes: bool = False,
    tilt: str | None = None,
    seed: int | None = None,
    fast: bool = False,
    homed: bool = True,
    imu: "ImuTopic | None" = None,
) -> "Iterator[OperatedRobot]":
    """Open a robot: simulated in this process, enabled and homed, or one on ROS, as it is.

    Raises:
        InputError: Options that do not go together.
        NotReadyError: Nobody said that the workspace is clear.
        TransportError: The robot is not there.
    """
    from catenary.workflows.robot.guide import clear_workspace
    from catenary.workflows.robot.operated_robot import robot_over, simulated_robot

    if ros is None:
        if namespace is not None or simulated or yes or dialect != "raven":
            raise InputError(
                "--dialect, --namespace, --simulated and --yes go with --ros; this robot is simulated here"
            )
        angles = (0.0, 0.0) if tilt is None else roll_and_pitch("--base-tilt-deg", tilt)
        yield simulated_robot(robot, seed=seed, base_tilt_deg=angles, homed=homed, real_time=not fast)
        return
    if tilt is not None or seed is not None or fast:
        raise InputError(
            "--base-tilt-deg, --robot-seed and --fast are of a robot simulated here; not with --ros"
        )
    with ros_transport(ros) as transport:
        opened, client = robot_over(
            transport, robot, dialect=dialect, namespace=namespace, simulated=simulated, imu=imu
        )
        with client:
            if moves and not simulated and not yes:
                clear_workspace(TerminalGuide())
            yield opened


@contextmanager
def recorded(robot: "OperatedRobot", folder: Path | None) -> "Iterator[Callable[[], str | None]]":
    """Record a robot beside what is done with it, into a folder or not at all: what to call after each tick."""
    if folder is None:
        yield lambda: None
        return
    from catenary.workflows.robot.beside_recorder import BesideRecorder

    recorder = BesideRecorder(robot, folder)
    try:
        yield recorder.observe
    finally:
        print_notes([recorder.close()])
