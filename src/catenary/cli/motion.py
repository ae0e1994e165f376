"""catenary goto, random, follow, teleop: a robot moved by hand, simulated or on ROS."""

import math
import sys
import time
from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from catenary.cli.exit_codes import code_of_signal
from catenary.cli.options import REQUIRED, Names, Numbers, Triple, argument, option, require_one
from catenary.cli.robot_options import MovedRobot, PacedRobot, chosen_robot, some_joint_values
from catenary.cli.terminal import announce, print_notes, print_result, progress_bar
from catenary.errors import LimitError
from catenary.tables import Table
from catenary.teleop.terminal import RawTerminal
from catenary.units import from_display, in_words

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.workflows.robot.homing import Homing
    from catenary.workflows.robot.operator_motion import MotionSummary


def goto(
    robot: PacedRobot,
    q_deg: Numbers | None = option("Q,Q,...", "Joint positions in deg and mm: of the first joints, or of --joints."),
    q: Numbers | None = option("Q,Q,...", "The same in rad and m."),
    joints: Names | None = option("NAME,...", "Which joints; the others stay.", goes_with=("q", "q_deg")),
    position_mm: Triple | None = option("X,Y,Z", "In place of joints: where the tool goes, in the base frame."),
    speed: float = option(None, "Factor on 0.2 rad/s and 10 mm/s, at most 5.", 1.0),
) -> None:
    """Move a robot to a place.

    All joints move slowly and arrive together. It prints the final positions of joints and tip in the units of the
    command; for a robot simulated here also the errors of the reported positions. Ctrl-C stops the robot. However
    the motion ends, the robot holds and is paused. A robot that is not homed and enabled is refused.

    Example: catenary goto --fast --q-deg 33,88,395
    """
    import numpy as np

    from catenary.workflows.robot.operator_motion import go_to_joints, joints_at

    require_one(q_deg=q_deg, q=q, position_mm=position_mm)
    place = None if position_mm is None else from_display(np.array(position_mm), "m")
    with chosen_robot(robot, "goto") as opened:
        names = joints
        if place is not None:
            goal = joints_at(opened, place, rng=np.random.default_rng(0))
        else:
            goal, names = some_joint_values(opened.plant, q, q_deg, names)
        try:
            with progress_bar("goto") as tell:
                summary = go_to_joints(opened, goal, joints=names, speed=speed, progress=tell)
        except LimitError as error:
            if q is None or np.abs(goal).max() <= 2.0 * np.pi:
                raise
            raise LimitError(f"{error}; --q takes rad and m, --q-deg takes deg and mm") from error
    _print_summary(summary, "arrived", si=q is not None, goal=place)


def random(
    robot: PacedRobot,
    seconds: float = option(None, "Length of the motion.", REQUIRED),
    seed: int = option(None, "Seed of the motion.", 0, min=0),
) -> None:
    """Move a robot at random, without recording it.

    Each joint moves by itself: a RAVEN-II in its calibration box, others in the middle of their ranges.
    Ctrl-C stops it where it is. However it ends, the robot holds and is paused.
    """
    import numpy as np

    from catenary.workflows.robot.operator_motion import run_random

    with chosen_robot(robot, "random") as opened, progress_bar("random") as tell:
        summary = run_random(opened, seconds, rng=np.random.default_rng(seed), progress=tell)
    _print_summary(summary, "done")


def follow(
    robot: PacedRobot,
    file: Path = argument("FILE", ".csv, .parquet, .npz: time, joints, with units."),
    rows_per_second: float | None = option(None, "Rate of a CSV that holds numbers alone. [default: 64.3]"),
    blend: float = option(None, "Seconds over which velocities are averaged.", 0.5),
    largest_deg_s: float | None = option(None, "Refuse faster rotation. [default: 28.6]"),
    largest_mm_s: float | None = option(None, "Refuse faster sliding. [default: 10]"),
    from_afar: bool = option(None, "Allow a start over 60 deg, 150 mm away.", False),
) -> None:
    """Move a robot along the rows of a file.

    The whole motion is checked before anything moves: units, limits, speeds, and the distance to its start.
    It always starts at the first row: a motion that was stopped (Ctrl-C) is not resumed.
    However it ends, the robot holds and is paused.
    """
    from catenary.workflows.robot.operator_motion import MAX_VELOCITY, along_rows, read_followed_file
    from catenary.workflows.robot.operator_motion import follow_motion as follow_file

    motion = read_followed_file(file, rows_per_second=rows_per_second)
    print_notes(motion.notes)
    fastest = dict(MAX_VELOCITY)
    for unit, typed in (("rad", largest_deg_s), ("m", largest_mm_s)):
        if typed is not None:
            fastest[unit] = from_display(typed, unit)
    assert motion.time is not None  # of a file to follow
    away = along_rows(motion, blend).corner_distance
    shown = ", ".join(in_words(value, unit, 2) for value, unit in zip(away, motion.joint_units, strict=True))
    print_notes([f"{len(motion)} rows, {motion.time[-1]:.1f} s; corners are passed within {shown}"])
    with chosen_robot(robot, "follow") as opened, progress_bar("follow") as tell:
        summary = follow_file(opened, motion, blend=blend, largest_velocity=fastest, from_afar=from_afar, progress=tell)
    _print_summary(summary, "followed to its end")


def teleop(
    robot: MovedRobot, not_homed: bool = option(None, "Simulated: begin with a robot that was just switched on.", False)
) -> None:
    """Move a robot from the keyboard.

    Joint by joint or along the axes, in any terminal and over SSH. Hold a key to move: all motion ends a
    quarter of a second after its last repeat. ? lists the keys. On every way out the robot holds, then is
    paused.
    """
    from catenary.teleop.session import TeleopSession

    terminal = RawTerminal()
    announce("preparing the robot ...")
    with chosen_robot(robot, "teleop", homed=not not_homed) as opened:
        with terminal:
            session = TeleopSession(opened.plant, opened.model, opened.name, terminal)
            why = session.run(time.monotonic)
        state, q = opened.plant.operating_state(), opened.plant.measured_js().q
    content = {"robot": opened.name, "ended_by": why, "state": state._asdict(), "q": q, "late_ticks": opened.late()}
    notes = [session.message] if "not paused" in session.message else []
    print_result(content, f"{opened.name}: ended by {why}; the robot is {state.state}", notes=notes)


def _print_summary(summary: "MotionSummary", what: str, *, si: bool = False, goal: "Floats | None" = None) -> None:
    """Print how a motion went (`si`: rad, m) towards the tip at `goal` (3,) [m]; exit by its signal, if any."""
    state = summary.state
    done = what if summary.ended_by is None else f"stopped by {summary.ended_by}; the robot holds here"
    homed = "" if state.is_homed else ", not homed"
    title = f"{summary.robot}: {done} after {summary.duration:.1f} s; {state.state}{homed}\n"
    late = f"{summary.late_ticks} ticks were late: each delayed the motion by as much"
    columns = {"now": summary.q, "largest error": summary.max_error, "rms error": summary.rms_error}
    columns |= {} if summary.true_error is None else {"true error": summary.true_error}
    joints = joints_table(summary, columns, "Joints: errors against what was commanded, as reported", 3, si=si)
    digits, scale, unit = (4, 1.0, "m") if si else (1, 1000.0, "mm")
    x, y, z = (f"{scale * value:.{digits}f}" for value in summary.tip)
    lines = [f"tip ({summary.tip_name}): {x}, {y}, {z} {unit} in the base frame, by reported joints"]
    if goal is not None:
        lines.append(f"distance from the goal: {in_words(math.dist(summary.tip, goal), 'm', 2)}")
    if summary.tip_error is not None:
        error = in_words(summary.tip_error, "m", 2)
        lines.append(f"true error of the {summary.true_frame}, which only a simulation knows: {error}")
    print_result(summary.as_data(), title, joints, *lines, notes=[late] if summary.late_ticks else [])
    if summary.ended_by is not None:
        sys.stdout.flush()
        raise typer.Exit(code_of_signal(summary.ended_by))


def joints_table(
    of: "MotionSummary | Homing", columns: "Mapping[str, Floats]", title: str, digits: int, *, si: bool = False
) -> "Table":
    """Return columns of numbers [rad|m] of a robot's joints, or of its first, in deg and mm or, with `si`, as such."""
    rows = [
        [name, *("" if v is None else f"{v:.4f} {unit}" if si else in_words(v, unit, digits) for v in values)]
        for name, unit, *values in zip_longest(of.joint_names, of.joint_units, *columns.values())
    ]
    return Table(["joint", *columns], rows, title)
