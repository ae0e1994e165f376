"""catenary home, excite, record: a robot finds its joints; a project's moves, or others move it, and is recorded."""

import json
import time
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli import projects
from catenary.cli.exit_codes import code_of_signal
from catenary.cli.motion import joints_table
from catenary.cli.options import argument, option
from catenary.cli.out_files import EXCITATION
from catenary.cli.robot_options import DIALECT, PacedRobot, TerminalGuide, chosen_robot
from catenary.cli.terminal import announce, print_notes, print_result, progress_bar
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.workflows.project.folder import Project
    from catenary.workflows.project.kinds import ProjectKind
    from catenary.workflows.robot.topic_recorder import RecordedTopics

_ROWS_PER_SECOND = 20.0  # of a file, between which catenary follow goes straight


def home(
    arm: projects.ArmOptions,
    access: projects.RobotAccess,
    project: Path | None = argument("PROJECT", "Folder of the robot's project; made if it is not there.", None),
    robot: str | None = option("ROBOT", "Robot to home; in a project raven2 or dvrk_psm. [default: raven2]"),
    dialect: str | None = replace(DIALECT, not_with="project"),
    namespace: str | None = replace(projects.ARM_NAMESPACE, goes_with=("ros", "project")),
) -> None:
    """Home a robot.

    Every axis runs into its stop, which registers its encoder. A robot on ROS is homed after somebody has
    said that its workspace is clear; Ctrl-C disables it. With a project the result is kept there.

    Example: catenary home --ros 1
    """
    if project is not None:
        opened = projects.open_project(project, arm, ros=access.ros, robot=robot, namespace=namespace)
        with opened, projects.project_robot(opened, access, "home") as own:
            announce("homing ...")
            was_run = own.home(opened)
        content = json.loads((opened.folder / "robot" / "home.json").read_bytes())
        projects.say_step(opened, "homed", was_run, content)
        return
    if access.ros is not None and (arm.seed is not None or arm.base_tilt_deg is not None):
        raise InputError("--seed and --base-tilt-deg go with a simulated robot, not with --ros")
    from catenary.workflows.robot.homing import AnswerYes, home_operated

    chosen = PacedRobot(
        robot=robot or "raven2", dialect=dialect, namespace=namespace, base_tilt_deg=arm.base_tilt_deg,
        robot_seed=arm.seed, fast=access.ros is None, **vars(access),
    )  # fmt: skip
    with chosen_robot(chosen, "home", moves=False, homed=False) as moved:
        guide = AnswerYes(announce) if access.yes or access.simulated else TerminalGuide()
        announce("homing ...")
        found = home_operated(moved, guide)
    how = f"homed in {found.seconds:.1f} s" if found.was_run else "homed before; nothing has moved"
    columns = {"now": found.believed}
    columns |= {} if found.external_encoders is None else {"external encoder": found.external_encoders}
    title = f"{found.robot}: {how}; {found.state.state}\n"
    print_result(found.as_data(), title, joints_table(found, columns, "Joints", 2))


def excite(
    arm: projects.ExcitationOptions,
    access: projects.RobotAccess,
    project: Path | None = argument("PROJECT", "Folder of the project; created if missing.", None),
    robot: str | None = projects.ARM_KIND,
    namespace: str | None = projects.ARM_NAMESPACE,
    refresh: bool = option(None, "Minutes of full reversals of each joint, for catenary refresh.", False),
    out: Path | None = option("FILE", "Write that motion; move nothing.", writes=EXCITATION, goes_with="refresh"),
) -> None:
    """Record a project's robot along its calibration motion.

    A RAVEN-II's is a zig-zag. Writes recordings/train, with --refresh recordings/refresh; homes first if needed.
    """
    from catenary.workflows.project.calibrate import TRAIN
    from catenary.workflows.project.kinds import project_kind

    if out is not None:
        settings = projects.settings_of(project, arm, robot=robot, namespace=namespace)
        _write_refresh_motion(project_kind(settings), out)
        return
    if project is None:
        raise InputError("PROJECT: is missing; it may be left out where --refresh --out writes a file")
    opened = projects.open_project(project, arm, ros=access.ros, robot=robot, namespace=namespace)
    kind = project_kind(opened.settings)
    motion, what = kind.refresh_motion() if refresh else kind.excitation()
    name = TRAIN
    if refresh:  # each day's minute is another one
        there = {path.name for path in (opened.folder / "recordings").glob("*")}
        names = chain(["refresh"], (f"refresh_{k}" for k in count(2)))
        name = next(name for name in names if name not in there)
    with opened, projects.project_robot(opened, access, "excite") as moved:
        with projects.step_progress("homing", opened):
            moved.home(opened)
        with projects.step_progress("excite", opened) as progress:
            was_run = moved.record(opened, name, motion, what, after="home", progress=progress)
    said = f"recorded {motion.duration:.0f} s as {name}"
    projects.say_step(opened, said, was_run, {"seconds": motion.duration, "recording": name})


def _write_refresh_motion(kind: "ProjectKind", out: Path) -> None:
    import numpy as np

    from catenary.plant import Joints
    from catenary.workflows.excitation import write_motion

    motion, _ = kind.refresh_motion()
    model, n = catenary.load_robot(kind.model), len(kind.joints)
    time = np.linspace(0.0, motion.duration, 1 + round(_ROWS_PER_SECOND * motion.duration))
    q, qd, qdd = (np.array(rows) for rows in zip(*map(motion, time.tolist()), strict=True))
    write_motion(out, Joints(kind.joints, model.joint_units[:n]), time, q, qd, qdd)
    content = {"file": str(out), "seconds": motion.duration, "joints": kind.joints}
    said = f"{motion.duration:.0f} s of full reversals of {', '.join(kind.joints)}\nfile: {out}"
    print_result(content, said)


def record(
    access: projects.RobotAccess,
    project: Path = projects.FOLDER,
    hours: float | None = projects.HOURS,
    name: str = option(None, "Name of the recording.", "test"),
    no_motion: bool = option(None, "With --ros: record the robot while somebody else moves it; Ctrl-C ends it.", False),
    robot: str | None = replace(projects.ARM_KIND, goes_with="no_motion"),
    namespace: str | None = replace(projects.ARM_NAMESPACE, goes_with="no_motion"),
) -> None:
    """Record a project's robot along a random motion, as a test.

    Writes recordings/NAME; after `catenary excite`.
    """
    from catenary.workflows.project.calibrate import TRAIN, evaluation_motion
    from catenary.workflows.project.folder import is_project

    if not name.isidentifier() or name == TRAIN:
        raise InputError(f'--name "{name}": expected letters, digits and _, and another name than {TRAIN}')
    if no_motion:
        begun = is_project(project)  # whose settings stay as they are
        if begun and (robot is not None or namespace is not None):
            raise InputError(f"--robot and --namespace begin a project, and {project} was begun")
        typed: dict[str, Any] = {} if begun else {"ros": access.ros, "robot": robot, "namespace": namespace}
        _record_others(projects.open_project(project, **typed), access, hours, name)
        return
    projects.require_project(project)
    with projects.open_project(project, hours=hours, ros=access.ros) as opened:
        seconds = 60.0 * opened.settings.test_minutes
        motion, what = evaluation_motion(opened, seconds)
        with (
            projects.project_robot(opened, access, "record") as moved,
            projects.step_progress("record", opened) as progress,
        ):
            was_run = moved.record(opened, name, motion, what, after=TRAIN, progress=progress)
        projects.say_step(opened, f"recorded {seconds:.0f} s as {name}", was_run, {"seconds": seconds})


def _record_others(project: "Project", access: projects.RobotAccess, hours: float | None, name: str) -> None:
    from catenary.crtk.network import make_transport, node_name
    from catenary.recording.journal import About
    from catenary.workflows.project.kinds import project_kind
    from catenary.workflows.robot.topic_recorder import left_off, record_topics

    with project as opened, progress_bar("record") as progress:
        connection = opened.settings.connection if access.ros is None else f"ros{access.ros}"
        if connection == "simulation":
            raise InputError("--no-motion: goes with --ros; only this command moves a simulated robot")
        seconds = 60.0 * opened.settings.test_minutes if hours is None else 3600.0 * hours
        if not 0.0 < seconds < float("inf"):
            raise InputError(f"--hours: expected more than 0, got {hours}")
        kind, folder = project_kind(opened.settings), opened.folder / "recordings" / name
        not_ours = {"motion": "not ours"}
        about = About(robot=kind.recorded_as, simulated=access.simulated, configuration=not_ours)
        left = left_off(folder, about, kind.topics, time.time_ns())
        if any(folder.glob("*")) and (left is None or left.begins > seconds - 1.0):
            raise InputError(f"{folder}: holds a recording already; give this one another --name")
        before = 0.0 if left is None else left.begins
        if left is not None:
            print_notes([f"{name}: {left.gap(time.time_ns())}"])
        found: list[RecordedTopics] = []

        def work() -> None:
            needed = [topic.name for topic in kind.required]
            how: dict[str, Any] = {"about": about, "after": left, "progress": progress, "required": needed}
            with make_transport(connection.removeprefix("ros"), node_name("record")) as transport:
                found.append(record_topics(transport, folder, kind.topics, seconds - before, **how))

        motion = {**not_ours, "seconds": seconds, "begun_ns": time.time_ns()}
        opened.run(f"record {name}", motion, [folder], work)
        (recorded,) = found
        print_notes([note for count in recorded.counts if (note := count.note()) is not None])
        ended_by = recorded.ended_by
        what = f"recorded {before + recorded.seconds:.0f} s as {name}" + (f", ended by {ended_by}" if ended_by else "")
        topics = [vars(count) for count in recorded.counts]
        content = {"seconds": before + recorded.seconds, "ended_by": ended_by or None, "topics": topics}
        projects.say_step(opened, what, True, content)
    if ended_by and hours is not None:  # it was to last as long
        raise typer.Exit(code_of_signal(ended_by))
