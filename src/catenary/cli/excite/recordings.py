"""catenary excite, record: a project's robot moves, or is moved by others, and is recorded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from catenary.cli.beside_robot import RobotAccess, record_others, robot_of
from catenary.cli.options import AsJson
from catenary.cli.project_options import (
    ArmKind,
    ArmNamespace,
    ExcitationOptions,
    Folder,
    Hours,
    open_project,
    require_project,
    say_step,
    step_progress,
)
from catenary.cli.signals import exit_code
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project


def excite(
    project: Folder,
    arm: ExcitationOptions,
    access: RobotAccess,
    robot: ArmKind = None,
    namespace: ArmNamespace = None,
    as_json: AsJson = False,
) -> None:
    """Drive the robot along its calibration motion and record it.

    A RAVEN-II's is a zig-zag. Writes recordings/train; homes first if needed.
    """
    from catenary.workflows.project.calibrate import TRAIN, excitation

    opened = open_project(project, arm, ros=access.ros, robot=robot, namespace=namespace)
    motion, what = excitation(opened)
    with opened, robot_of(opened, access, "excite") as moved:
        with step_progress("homing", opened):
            moved.home(opened)
        with step_progress("excite", opened) as progress:
            was_run = moved.record(opened, TRAIN, motion, what, after="home", progress=progress)
    said = f"recorded {motion.duration:.0f} s as {TRAIN}"
    say_step(opened, said, was_run, as_json, {"seconds": motion.duration})


def record(
    project: Folder,
    access: RobotAccess,
    hours: Hours = None,
    name: Annotated[str, Option(help="Name of the recording.")] = "test",
    no_motion: Annotated[
        bool,
        Option(
            "--no-motion", help="With --ros: record the robot while somebody else moves it; Ctrl-C ends it."
        ),
    ] = False,
    robot: ArmKind = None,
    namespace: ArmNamespace = None,
    as_json: AsJson = False,
) -> None:
    """Drive the robot along a random motion and record it.

    Writes recordings/NAME; after `catenary excite`.
    """
    from catenary.workflows.project.calibrate import TRAIN, random_motion

    if not name.isidentifier() or name == TRAIN:
        raise InputError(f'--name "{name}": expected letters, digits and _, and another name than {TRAIN}')
    if no_motion:
        begun = _begun_by_others(project, access, robot, namespace)
        _record_others(begun, access, hours, name, as_json)
        return
    if robot is not None or namespace is not None:
        raise InputError("--robot and --namespace go with --no-motion, or with what begins a project: excite")
    require_project(project)
    with open_project(project, hours=hours, ros=access.ros) as opened:
        seconds = 60.0 * opened.settings.test_minutes
        motion, what = random_motion(opened, seconds)
        with robot_of(opened, access, "record") as moved, step_progress("record", opened) as progress:
            was_run = moved.record(opened, name, motion, what, after=TRAIN, progress=progress)
        say_step(opened, f"recorded {seconds:.0f} s as {name}", was_run, as_json, {"seconds": seconds})


def _begun_by_others(
    project: Path, access: RobotAccess, robot: str | None, namespace: str | None
) -> "Project":
    """Open or begin a project whose robot somebody else moves; the settings of one that was begun stay as they are."""
    from catenary.workflows.project.folder import is_project

    if not is_project(project):
        return open_project(project, ros=access.ros, robot=robot, namespace=namespace)
    if robot is not None or namespace is not None:
        raise InputError(f"--robot and --namespace begin a project, and {project} was begun")
    return open_project(project)


def _record_others(
    project: "Project", access: RobotAccess, hours: float | None, name: str, as_json: bool
) -> None:
    """Record a robot that somebody else moves."""
    with project as opened:
        connection = opened.settings.connection if access.ros is None else f"ros{access.ros}"
        if connection == "simulation":
            raise InputError("--no-motion: goes with --ros; only this command moves a simulated robot")
        seconds = 60.0 * opened.settings.test_minutes if hours is None else 3600.0 * hours
        if not 0.0 < seconds < float("inf"):
            raise InputError(f"--hours: expected more than 0, got {hours}")
        with step_progress("record") as progress:
            recorded = record_others(
                opened, name, seconds, ros=int(connection.removeprefix("ros")), simulated=access.simulated,
                progress=progress,
            )  # fmt: skip
        ended_by = recorded.ended_by
        what = f"recorded {recorded.seconds:.0f} s as {name}" + (f", ended by {ended_by}" if ended_by else "")
        content = {"seconds": recorded.seconds, "ended_by": ended_by or None}
        say_step(
            opened, what, True, as_json, {**content, "topics": [vars(count) for count in recorded.counts]}
        )
    if ended_by and hours is not None:  # it was to last as long
        raise typer.Exit(exit_code(ended_by))
