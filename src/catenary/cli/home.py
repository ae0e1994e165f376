"""catenary home: a robot finds its joints; a project's, one simulated for the moment, or one on ROS."""

from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from catenary.cli.beside_robot import RobotAccess, TerminalGuide, robot_of
from catenary.cli.options import AsJson, robots_beginning
from catenary.cli.project_options import ArmOptions, open_project
from catenary.cli.robot_choice import PacedRobot, open_robot
from catenary.cli.terminal import announce, print_json, print_table
from catenary.errors import InputError
from catenary.units import in_words

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project
    from catenary.workflows.robot.homing import Homing


def home(
    arm: ArmOptions,
    access: RobotAccess,
    project: Annotated[
        Path | None,
        Argument(metavar="PROJECT", help="Folder of the robot's project; made if it is not there."),
    ] = None,
    robot: Annotated[
        str | None,
        Option(
            metavar="ROBOT",
            help="Which one; of a project raven2 or dvrk_psm. [default: raven2]",
            autocompletion=robots_beginning,
        ),
    ] = None,
    dialect: Annotated[
        str | None, Option(help="Without a project, with --ros: raven or crtk. [default: the robot's own]")
    ] = None,
    namespace: Annotated[
        str | None,
        Option(metavar="/NAME", help="With --dialect crtk, or of a dVRK PSM: in front of its verbs."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Home a robot.

    Every axis runs into its stop, which registers its encoder. A robot on ROS is homed after somebody has
    said that its workspace is clear; Ctrl-C disables it. With a project the result is kept there.

    Example: catenary home --ros 1
    """
    if project is not None:
        if dialect is not None:
            raise InputError("--dialect goes without a project; a project's robot speaks its own")
        opened = open_project(project, arm, ros=access.ros, robot=robot, namespace=namespace)
        _home_project(opened, access, as_json)
        return
    if arm.payload is not None or arm.side is not None:
        raise InputError("--payload and --side go with a project; without one give --robot raven2_right")
    from catenary.workflows.robot.homing import AnswerYes, home_operated

    chosen = PacedRobot(
        robot=robot or "raven2",
        ros=access.ros,
        dialect=dialect,
        namespace=namespace,
        simulated=access.simulated,
        base_tilt_deg=arm.base_tilt_deg,
        robot_seed=arm.seed,
        yes=access.yes,
        fast=access.ros is None,
    )
    with open_robot(chosen, "home", moves=False, homed=False) as moved:
        guide = AnswerYes(announce) if access.yes or access.simulated else TerminalGuide()
        announce("homing ...")
        found = home_operated(moved, guide)
    _say(found, as_json)


def _home_project(opened: "Project", access: RobotAccess, as_json: bool) -> None:
    with opened, robot_of(opened, access, "home") as robot:
        announce("homing ...")
        was_run = robot.home(opened)
    if as_json:
        from catenary.workflows.project.state import HomeFile, read_state

        remedy = "delete it, and `catenary home PROJECT` makes it again"
        content = read_state(opened.folder / "robot" / "home.json", HomeFile, remedy)
        print_json({"project": str(opened.folder), "run": was_run, **content})
    else:
        print(f"{opened.folder}: homed" + ("" if was_run else " before; nothing to do"))


def _say(found: "Homing", as_json: bool) -> None:
    if as_json:
        print_json(found.as_data())
        return
    how = f"homed in {found.seconds:.1f} s" if found.was_run else "homed before; nothing has moved"
    print(f"{found.robot}: {how}; {found.state.state}\n")
    columns = [found.believed]
    if found.external_encoders is not None:
        columns.append(found.external_encoders)
    rows = [
        [name, *("" if q is None else in_words(q, unit, 2) for q in seen)]
        for name, unit, *seen in zip_longest(found.joint_names, found.joint_units, *columns)
    ]
    print_table("Joints", ["joint", "now", "external encoder"][: 1 + len(columns)], rows)
