"""What commands on a project share: options, the project that they open, its robot, what they say of a step."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from catenary.cli.gravity_options import TILT_OF_BASE
from catenary.cli.options import Names, Numbers, argument, group, option, robots_beginning, words
from catenary.cli.robot_choice import TerminalGuide, ros_transport
from catenary.cli.terminal import announce, print_json, progress_bar
from catenary.crtk.dds.arguments import said_ros_arguments
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project, ProjectSettings
    from catenary.workflows.project.robot import ProjectRobot

FOLDER = argument("PROJECT", "Folder of the project; made if it is not there.")
BEGUN_FOLDER = argument("PROJECT", "Folder of a project that was begun.")
SEED = option(None, "Simulate another robot, drawn with this seed. [default: the nominal one]")
ARM_NAMESPACE = option("/NAME", "Of a dVRK PSM: in front of its topics. [default: /PSM1]")
ARM_KIND = option(
    "ROBOT", "Which robot a new project is of: raven2 or dvrk_psm. [default: raven2]", completes=robots_beginning
)
HOURS = option(None, "Length of the random motion.")


@group
class ArmOptions:
    """Options that say which RAVEN-II a project is about, by the names of its settings; None is not typed."""

    seed: int | None = SEED
    base_tilt_deg: tuple[float, float] | None = TILT_OF_BASE
    payload_kg: float | None = option("KG", "Mass at the tool's wrist.", flag="--payload")
    side: str | None = option(None, "left (gold) or right (green). [default: left]")


def _fractions(text: str) -> Numbers:
    found = []
    for word in words(text):
        upper, _, lower = word.partition("/")
        try:
            found.append(float(upper) / float(lower or 1.0))
        except (ValueError, ZeroDivisionError):
            raise typer.BadParameter(f"expected numbers such as 1/2 or 0.5, got {word!r}") from None
    return tuple(found)


@group
class ExcitationOptions(ArmOptions):
    """Options of an arm, and of the zig-zag that it is calibrated with."""

    direction: str | None = option(None, "Joints that the zig-zag sweeps: J1, J2, J3, J1-J2, J2-J3, J1-J3, J1-J2-J3.")
    form: str | None = option(None, "Which published J1-J2-J3: generator, files or paper. [default: generator]")
    sparsities: Numbers | None = option(
        "S,S,...", "Sparsities of the zig-zags. [default: 1/2,1/3,1/4]", read=_fractions, flag="--sparsity"
    )
    train_minutes: float | None = option("MIN", "Length of a dVRK PSM's motion to train on. [default: 20]")
    state_rate_hz: float | None = option("HZ", "Rate of raven_state, 30 or 100. [default: 30]", flag="--state-rate")


@group
class RobotAccess:
    """Options of a project's robot: where it is, and whether a person beside it is asked."""

    ros: int | None = option(
        "1|2", "Robot on ROS 1 or 2. [default: the project's, simulated at first]", choices=(1, 2), joins_ros=True
    )
    yes: bool = option(None, "With --ros: do not ask; the robot's state must permit each step.", False)
    simulated: bool = option(None, "With --ros: that robot is a simulation; recordings say so.", False)


def open_project(
    folder: Path,
    arm: ArmOptions | None = None,
    *,
    hours: float | None = None,
    ros: int | None = None,
    columns: Names | None = None,
    robot: str | None = None,
    namespace: str | None = None,
) -> "Project":
    """Open a project with the settings it has, changed by what was typed."""
    from catenary.workflows.project.folder import Project

    typed = {
        "connection": None if ros is None else f"ros{ros}",
        "robot": robot,
        "namespace": namespace,
        "columns": columns,
        "test_minutes": None if hours is None else 60.0 * hours,
    }
    return Project(folder, settings_of(folder, arm, **typed))


def settings_of(folder: Path | None, arm: ArmOptions | None = None, **typed: Any) -> "ProjectSettings":
    """Return the settings that a project has, those of a new one where there is none, changed by what was typed."""
    from catenary.workflows.project.folder import ProjectSettings, project_settings

    given = {**typed, **({} if arm is None else vars(arm))}
    changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    found = None if folder is None else project_settings(folder)
    return replace(found or ProjectSettings(), **changes)


def require_project(folder: Path) -> None:
    """Refuse a folder in which nothing was begun, so that a mistyped name makes no new project."""
    from catenary.workflows.project.folder import is_project

    if not is_project(folder):
        raise InputError(f"{folder}: is no project; begin one with catenary home, excite or calibrate")


@contextmanager
def robot_of(project: "Project", access: RobotAccess, command: str) -> "Iterator[ProjectRobot]":
    """Open the robot that a project is about, for a command: its simulated one, or one on ROS."""
    from catenary.crtk.network import node_name
    from catenary.workflows.project.robot import RosRobot, SimulatedRobot
    from catenary.workflows.robot.homing import AnswerYes

    connection = project.settings.connection
    said = said_ros_arguments()
    for typed, value in (("--ros-distro", said.distro), ("--transport", said.transport)):
        if value is not None and connection != "ros2":
            raise InputError(f"{typed} {value}: goes with --ros 2; this project's robot is not on ROS 2")
    if connection == "simulation":
        if access.yes or access.simulated:
            raise InputError("--yes and --simulated go with --ros; this project's robot is simulated here")
        yield SimulatedRobot()
        return
    guide = AnswerYes(announce) if access.yes else TerminalGuide()
    with ros_transport(int(connection.removeprefix("ros")), node_name(command)) as transport:
        yield RosRobot(transport, guide, simulated=access.simulated)


def say_step(project: "Project", what: str, was_run: bool, as_json: bool, content: Any) -> None:
    """Say what a step did, or that it had been done."""
    if as_json:
        print_json({"project": str(project.folder), "run": was_run, **content})
    else:
        print(f"{project.folder}: {what}" + ("" if was_run else " before; nothing to do"))


@contextmanager
def step_progress(label: str, project: "Project | None" = None) -> Iterator[Callable[[float], None]]:
    """Show a bar while a step runs."""
    if project is not None and project.settings.connection != "simulation":
        yield lambda _: None  # a bar would hide what the person beside the robot is asked
        return
    with progress_bar(label) as progress:
        yield progress
