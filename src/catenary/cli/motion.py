"""catenary goto, random, follow: a robot moved by hand, simulated or on ROS."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from catenary.cli.joint_options import some_joint_values
from catenary.cli.robot_choice import PacedRobot, open_robot
from catenary.cli.signals import exit_code
from catenary.cli.terminal import numbers, print_json, print_notes, print_table, progress_bar, words
from catenary.errors import InputError, LimitError
from catenary.units import in_words

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.workflows.robot.operator_motion import MotionSummary

AsJson = Annotated[bool, Option("--json", help="Print JSON, in rad and m.")]


def goto(
    robot: PacedRobot,
    q_deg: Annotated[
        str | None,
        Option(metavar="Q,Q,...", help="Joints in deg and mm: the first ones, or those of --joints."),
    ] = None,
    q: Annotated[str | None, Option(metavar="Q,Q,...", help="The same in rad and m.")] = None,
    joints: Annotated[str | None, Option(metavar="NAME,...", help="Which joints; the others stay.")] = None,
    position_mm: Annotated[
        str | None,
        Option(metavar="X,Y,Z", help="In place of joints: where the tool goes, in the base frame."),
    ] = None,
    speed: Annotated[float, Option(help="Factor on 0.2 rad/s and 10 mm/s, at most 5.")] = 1.0,
    as_json: AsJson = False,
) -> None:
    """Move a robot to a place.

    It goes gently, all joints arriving together, and prints where joints and tip ended, in the units that were asked
    in; of a robot simulated here also how far they really are from what is reported. Ctrl-C stops it there. However
    it ends, the robot holds and is paused. A robot that is not homed and enabled is refused.

    Example: catenary goto --fast --q-deg 33,88,395
    """
    import numpy as np

    from catenary.workflows.robot.operator_motion import go_to_joints, joints_at

    if sum(option is not None for option in (q_deg, q, position_mm)) != 1:
        raise InputError("goto: give one of --q-deg, --q and --position-mm")
    if position_mm is not None and joints is not None:
        raise InputError("goto: --joints goes with --q-deg or --q")
    place = None if position_mm is None else np.array(numbers("--position-mm", position_mm, 3)) / 1000.0
    with open_robot(robot, "goto") as opened:
        names = None if joints is None else words(joints)
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
    _say(summary, as_json, "arrived", si=q is not None, asked=place)


def random(
    robot: PacedRobot,
    seconds: Annotated[float, Option(help="Length of the motion.")],
    seed: Annotated[int, Option(min=0, help="Seed of the motion.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Move a robot at random.

    Each joint moves by itself: a RAVEN-II in its calibration box, others in the middle of their ranges.
    Ctrl-C stops it where it is. However it ends, the robot holds and is paused.
    """
    import numpy as np

    from catenary.workflows.robot.operator_motion import run_random

    with open_robot(robot, "random") as opened, progress_bar("random") as tell:
        summary = run_random(opened, seconds, rng=np.random.default_rng(seed), progress=tell)
    _say(summary, as_json, "done")


def follow(
    robot: PacedRobot,
    file: Annotated[Path, Argument(metavar="FILE", help=".csv, .parquet, .npz: time, joints, with units.")],
    rows_per_second: Annotated[
        float | None, Option(help="Rate of a CSV that holds numbers alone. [default: 64.3]")
    ] = None,
    blend: Annotated[float, Option(help="Seconds over which velocities are averaged.")] = 0.5,
    largest_deg_s: Annotated[float | None, Option(help="Refuse to turn faster. [default: 28.6]")] = None,
    largest_mm_s: Annotated[float | None, Option(help="Refuse to slide faster. [default: 10]")] = None,
    from_afar: Annotated[bool, Option("--from-afar", help="Allow a start over 60 deg, 150 mm away.")] = False,
    as_json: AsJson = False,
) -> None:
    """Move a robot along a file.

    It begins at the beginning, and all of it is checked before anything moves: units, limits, speeds, how
    far away it starts. A motion that was stopped (Ctrl-C) is not taken up again where it ended: the next
    one begins at the beginning. However it ends, the robot holds and is paused.
    """
    import numpy as np

    from catenary.workflows.robot.followed_file import read_followed_file
    from catenary.workflows.robot.operator_motion import LARGEST_VELOCITY
    from catenary.workflows.robot.operator_motion import follow as follow_file

    motion = read_followed_file(file, rows_per_second=rows_per_second)
    print_notes(motion.notes)
    fastest = dict(LARGEST_VELOCITY)
    for unit, typed, scale in (("rad", largest_deg_s, np.pi / 180.0), ("m", largest_mm_s, 1e-3)):
        if typed is not None:
            fastest[unit] = typed * scale
    away = motion.leaves_rows(motion.trajectory(blend), blend)
    shown = ", ".join(in_words(value, unit, 2) for value, unit in zip(away, motion.joint_units, strict=True))
    print_notes([f"{len(motion.q)} rows, {motion.time[-1]:.1f} s; corners are passed within {shown}"])
    with open_robot(robot, "follow") as opened, progress_bar("follow") as tell:
        summary = follow_file(
            opened, motion, blend=blend, largest_velocity=fastest, from_afar=from_afar, progress=tell
        )
    _say(summary, as_json, "followed to its end")


def _say(
    summary: "MotionSummary", as_json: bool, what: str, *, si: bool = False, asked: "Floats | None" = None
) -> None:
    """Print how a motion went; one that was ended before its end exits as `exit_code` says.

    Args:
        summary: What is told.
        as_json: As JSON, in rad and m.
        what: The robot did when it came to the motion's end.
        si: Joints in rad and m, as they were asked for, not in deg and mm.
        asked: (3,) [m] where the tip was to go, if it was.
    """
    if as_json:
        print_json(summary.as_data())
    else:
        state = summary.state
        done = what if summary.ended_by is None else f"stopped by {summary.ended_by}; the robot holds here"
        print(
            f"{summary.robot}: {done} after {summary.duration:.1f} s; {state.state}"
            f"{'' if state.is_homed else ', not homed'}\n"
        )
        _print_joints(summary, si=si)
        _print_tip(summary, si=si, asked=asked)
        if summary.late_ticks:
            print_notes([f"{summary.late_ticks} ticks were late: each delayed the motion by as much"])
    if summary.ended_by is not None:
        sys.stdout.flush()
        raise typer.Exit(exit_code(summary.ended_by))


def _print_joints(summary: "MotionSummary", *, si: bool) -> None:
    header = ["joint", "now", "largest error", "rms error"]
    columns = [summary.q, summary.max_error, summary.rms_error]
    if summary.true_error is not None:
        header.append("true error")
        columns.append(summary.true_error)
    rows = []
    for j, (name, unit) in enumerate(zip(summary.joint_names, summary.joint_units, strict=True)):
        values = [_in_units(column[j], unit, si) if j < len(column) else "" for column in columns]
        rows.append([name, *values])
    print_table("Joints: errors against what was commanded, as reported", header, rows)


def _print_tip(summary: "MotionSummary", *, si: bool, asked: "Floats | None") -> None:
    import numpy as np

    digits, scale, unit = (4, 1.0, "m") if si else (1, 1000.0, "mm")
    x, y, z = (f"{scale * value:.{digits}f}" for value in summary.tip)
    print(f"tip ({summary.tip_name}): {x}, {y}, {z} {unit} in the base frame, by reported joints")
    if asked is not None:
        print(f"from where it was sent: {1000.0 * float(np.linalg.norm(summary.tip - asked)):.2f} mm")
    if summary.tip_error is not None:
        error = f"{1000.0 * summary.tip_error:.2f} mm"
        print(f"true error of the {summary.true_frame}, which only a simulation knows: {error}")


def _in_units(value: float, unit: str, si: bool) -> str:
    return f"{value:.4f} {unit}" if si else in_words(value, unit, 3)
