"""What commands on a project share: options, the project that they open, its robot, what they say of a step."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from catenary.cli.gravity_options import BASE_TILT
from catenary.cli.options import Numbers, argument, group, option, words
from catenary.cli.robot_options import SIMULATED_SEED, TerminalGuide
from catenary.cli.terminal import announce, print_result, progress_bar
from catenary.crtk.network import said_ros_arguments
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project, ProjectSettings
    from catenary.workflows.project.robot import ProjectRobot

FOLDER = argument("PROJECT", "Folder of the project; created if missing.")
BEGUN_FOLDER = argument("PROJECT", "Folder of a project that was begun.")
ARM_NAMESPACE = option("/NAME", "Namespace of a dVRK PSM's topics. [default: /PSM1]")
ARM_KIND = option("ROBOT", "Robot of a new project: raven2 or dvrk_psm. [default: raven2]")
HOURS = option(None, "Length of the random motion.")


@group
class ArmOptions:
    """Options that say which RAVEN-II a project is about, by the names of its settings; None is not typed."""

    seed: int | None = SIMULATED_SEED
    base_tilt_deg: tuple[float, float] | None = BASE_TILT
    payload_kg: float | None = option("KG", "Mass at the tool's wrist.", flag="--payload", goes_with="project")
    side: str | None = option("left|right", "The gold or the green arm. [default: left]", goes_with="project")


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
    form: str | None = option("generator|files|paper", "Published form of the J1-J2-J3 zig-zag. [default: generator]")
    sparsities: Numbers | None = option(
        "S,S,...", "Sparsities of the zig-zags. [default: 1/2,1/3,1/4]", read=_fractions, flag="--sparsity"
    )
    random_seconds: float | None = option(
        "S", "Random motion after a zig-zag, to find delays of single joints; 0 for none. [default: 30]"
    )
    train_minutes: float | None = option("MIN", "Length of a dVRK PSM's training motion. [default: 20]")
    state_rate_hz: float | None = option("HZ", "Rate of raven_state, 30 or 100. [default: 30]", flag="--state-rate")


_ON_ROS = ("ros", "project")  # whose settings may say that its robot is on ROS


@group
class RobotAccess:
    """Options of a project's robot: where it is, and whether the operator is asked."""

    ros: int | None = option("1|2", "Robot on ROS 1 or 2. [default: the project's, simulated at first]", joins_ros=True)
    yes: bool = option(None, "With --ros: do not ask; its state must permit each step.", False, goes_with=_ON_ROS)
    simulated: bool = option(None, "With --ros: the robot is simulated; recordings say so.", False, goes_with=_ON_ROS)


def open_project(folder: Path, arm: ArmOptions | None = None, **typed: Any) -> "Project":
    """Open a project with the settings it has, changed by what was typed; see `settings_of`."""
    from catenary.workflows.project.folder import Project

    return Project(folder, settings_of(folder, arm, **typed))


def settings_of(
    folder: Path | None,
    arm: ArmOptions | None = None,
    *,
    hours: float | None = None,
    ros: int | None = None,
    **typed: Any,
) -> "ProjectSettings":
    """Return the settings that a project has, or a new one, changed by what was typed: columns, robot, namespace."""
    from catenary.workflows.project.folder import ProjectSettings, project_settings

    given = {**typed, **({} if arm is None else vars(arm)), "connection": ros and f"ros{ros}"}
    given["test_minutes"] = None if hours is None else 60.0 * hours
    changes: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    found = None if folder is None else project_settings(folder)
    return replace(found or ProjectSettings(), **changes)


def require_project(folder: Path) -> None:
    """Refuse a folder in which nothing was begun, so that a mistyped name makes no new project."""
    from catenary.workflows.project.folder import is_project

    if not is_project(folder):
        raise InputError(f"{folder}: is not a project; begin one with catenary home, excite or calibrate")


@contextmanager
def project_robot(project: "Project", access: RobotAccess, command: str) -> "Iterator[ProjectRobot]":
    """Open the robot that a project is about, for a command: its simulated one, or one on ROS."""
    from catenary.crtk.network import make_transport, node_name
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
    with make_transport(connection.removeprefix("ros"), node_name(command)) as transport:
        yield RosRobot(transport, guide, simulated=access.simulated)


def say_step(project: "Project", what: str, was_run: bool, content: Any) -> None:
    """Print the result of a step, or that it had been done before."""
    said = f"{project.folder}: {what}{'' if was_run else ' before; nothing to do'}"
    print_result({"project": str(project.folder), "run": was_run, **content}, said)


def step_progress(label: str, project: "Project") -> AbstractContextManager[Callable[[float], None]]:
    """Show a bar while a step runs; none beside a robot on ROS, where it would hide the questions to the operator."""
    return progress_bar(label) if project.settings.connection == "simulation" else nullcontext(lambda _: None)
