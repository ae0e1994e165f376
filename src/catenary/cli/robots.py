"""catenary robots, fk, ik, plot, regressor: what is known of a robot without any recording."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import catenary
from catenary.cli.gravity_options import GravityOptions
from catenary.cli.options import REQUIRED, Names, Numbers, Triple, argument, option
from catenary.cli.out_files import NAMED_AS_TYPED, PICTURE
from catenary.cli.recording_options import OWN_CLASS, ModelRecordingOptions
from catenary.cli.robot_options import ROBOT, DescriptionOptions, JointOptions, LoadedOptions, beyond_limits
from catenary.cli.terminal import print_notes, print_result, without_notes
from catenary.errors import InputError
from catenary.reports.page import write_picture
from catenary.tables import Column, Table
from catenary.units import from_display, in_words

if TYPE_CHECKING:
    from catenary.dynamics.inverse_kinematics import Match
    from catenary.spatial import Pose
    from catenary.workflows.regressor_report import RegressorReport

_MAX_NAMES_LENGTH = 30  # characters, so that a robot's line fits into a terminal of 80
Quaternion = tuple[float, float, float, float]
_FRAME_NAME = option("FRAME", "Frame of the robot. [default: its tip]")
_IN_FRAME = option("FRAME", "Frame that the pose is expressed in. [default: base]", flag="--in")


def robots() -> None:
    """List the robots that come with the package."""
    from catenary.robots.catalog import robot_names

    with without_notes(True):  # those that a robot has when it is named
        models = [catenary.load_robot(name) for name in robot_names()]
    content = [{"name": m.name, "joints": m.joint_names, "units": m.joint_units, "tip": m.tip} for m in models]
    columns: list[Column] = ["name", ("joints", _kinds), "tip", ("joint names", _names_in_brief)]
    legend = "R: revolute, P: prismatic; catenary check ROBOT names joints with their limits"
    print_result(content, Table(columns, models, "Robots", left_aligned=4), legend)


def _kinds(model: "catenary.RobotModel") -> str:
    turning = model.joint_units.count("rad")
    counts = ((turning, "R"), (model.n - turning, "P"))
    return " ".join(f"{count}{kind}" for count, kind in counts if count)


def _names_in_brief(model: "catenary.RobotModel") -> str:
    names = ", ".join(model.joint_names)
    return names if len(names) <= _MAX_NAMES_LENGTH else f"{model.joint_names[0]} ... {model.joint_names[-1]}"


def fk(
    joints: JointOptions, robot: str = ROBOT, frame: str | None = _FRAME_NAME, in_frame: str | None = _IN_FRAME
) -> None:
    """Print the pose of a robot's frame.

    Example: catenary fk raven2_full --q-deg 30,90,400,0,0,0
    """
    from catenary.dynamics.kinematics import relative_pose

    model = catenary.load_robot(robot)
    values = joints.of(model)
    print_notes(beyond_limits(model, values))
    name, in_frame = frame or model.tip, in_frame or model.base
    shown = {in_frame, "base"} if model.base == "base" else {in_frame}
    resting = [f for f in model.frames if model.frames[f].link < 0 and f not in shown]
    poses = {f: relative_pose(model, values, name, f) for f in (in_frame, *resting)}
    header = {"robot": model.name, "q": values, "unit": model.joint_units, "frame": name, "in": in_frame}
    others = {f: pose_numbers(pose) for f, pose in poses.items() if f != in_frame}
    content = {**header, **pose_numbers(poses[in_frame]), "in_other_frames": others}
    print_result(content, _pose_table("in", poses, f"{model.name}: pose of {name}"))


def ik(
    joints: JointOptions,
    robot: str = ROBOT,
    position_mm: Triple | None = option("X,Y,Z", "Position of the frame."),
    rpy_deg: Triple | None = option(
        "R,P,Y", "Orientation of the frame: turned about fixed x, y, z.", goes_with="position_mm", not_with="quaternion"
    ),
    quaternion: Quaternion | None = option("W,X,Y,Z", "Orientation of the frame.", goes_with="position_mm"),
    frame: str | None = _FRAME_NAME,
    in_frame: str | None = _IN_FRAME,
    seed: int = option("N", "Seed of the random starts, where a search needs several.", 0, min=0),
) -> None:
    """Print the joints that bring a robot's frame to a pose.

    Without an orientation, any will do. The search starts from --q; without a position, the pose there is the goal.

    Example: catenary ik raven2 --position-mm 19,-7.4,-67
    """
    import numpy as np

    from catenary.dynamics.inverse_kinematics import inverse_kinematics
    from catenary.dynamics.kinematics import relative_pose

    model = catenary.load_robot(robot)
    name, in_frame = frame or model.tip, in_frame or model.base
    start = joints.or_none(model)
    if position_mm is None:
        if start is None:
            raise InputError("ik: give the goal with --position-mm, or with --q joints whose pose it is")
        goal = relative_pose(model, start, name, in_frame)
    else:
        goal = _goal(position_mm, rpy_deg, quaternion)
    if model.frame(in_frame).link >= 0:
        resting = [frame for frame in model.frames if model.frames[frame].link < 0]
        raise InputError(f"ik: --in {in_frame}: moves with the joints; expected one of {', '.join(resting)}")
    base_pose = relative_pose(model, np.zeros(model.n), in_frame, model.base) @ goal
    match: Match | None = None
    if position_mm is not None:
        match = "position" if rpy_deg is None and quaternion is None else "pose"
    rng = np.random.default_rng(seed)
    solution = inverse_kinematics(model, base_pose, start, frame=name, match=match, rng=rng)
    reached = relative_pose(model, solution, name, in_frame)
    header = {"robot": model.name, "q": solution, "unit": model.joint_units, "frame": name, "in": in_frame}
    unknown = {"quaternion": None, "rotation": None} if match == "position" else {}
    content = {**header, "goal": pose_numbers(goal) | unknown, "reached": pose_numbers(reached)}
    rows = [
        [n, f"{v:.9g} {u}", in_words(v, u, 4)]
        for n, v, u in zip(model.joint_names, solution, model.joint_units, strict=True)
    ]
    title = f"{model.name}: joints that bring {name} to the goal"
    free = "goal" if match == "position" else ""
    poses = _pose_table("", {"goal": goal, "reached": reached}, f"Pose in {in_frame}", free=free)
    print_result(content, Table(["joint", "", ""], rows, title), poses)


def pose_numbers(pose: "Pose") -> dict[str, Any]:
    """Return a pose as plain data: position [m], quaternion (w, x, y, z), rotation matrix."""
    from catenary.spatial import quaternion_from_rotation

    quaternion = quaternion_from_rotation(pose.rotation)
    return {"position": pose.position, "quaternion": quaternion, "rotation": pose.rotation}


def _pose_table(first: str, poses: "dict[str, Pose]", title: str, *, free: str = "") -> "Table":
    """Return a table of poses, a row each; the orientation of the one that is named `free` may be any."""
    columns: list[Column] = [first, *((f"{axis} [mm]", ":.3f") for axis in "xyz"), *((part, ":.6f") for part in "wxyz")]
    rows = []
    for name, pose in poses.items():
        wxyz = ["any"] * 4 if name == free else pose_numbers(pose)["quaternion"]
        rows.append([name, *(1000.0 * pose.position), *wxyz])
    return Table(columns, rows, title)


def _goal(position_mm: Triple, rpy_deg: Triple | None, quaternion: Numbers | None) -> "Pose":
    import numpy as np

    from catenary.arrays import as_array
    from catenary.spatial import Pose, rotation_from_quaternion, rotation_from_rpy

    rotation = np.eye(3)
    if rpy_deg is not None:
        rotation = rotation_from_rpy(from_display(as_array("--rpy-deg", rpy_deg, (3,)), "rad"))
    elif quaternion is not None:
        rotation = rotation_from_quaternion(quaternion)
    return Pose(rotation, from_display(as_array("--position-mm", position_mm, (3,)), "m"))


def plot(
    stated: GravityOptions,
    loaded: LoadedOptions,
    recordings: ModelRecordingOptions,
    joints: JointOptions,
    robot: str = replace(ROBOT, metavar="ROBOT|MODEL", help=f"{ROBOT.help} With LOG: a calibration model."),
    log: Path | None = argument("LOG", "A recording: draw the model's errors on it, one column wide.", None),
    schematic: str | None = option(
        "cables|signals|commands|model",
        "Instead: a RAVEN-II's cables, its signals, commands, or MODEL.",
        not_with="log",
    ),
    own: str | None = replace(OWN_CLASS, goes_with=("log", "schematic")),
    joint: str | None = option("NAME", "With LOG: the joint to draw. [default: the first]", goes_with="log"),
    hide: Names | None = option("PART,...", "What not to draw, of frames, masses, gravity and torques."),
    out: Path = option("FILE", f"Picture to write, .png, .svg or .pdf. {NAMED_AS_TYPED}", REQUIRED, writes=PICTURE),
) -> None:
    """Draw a robot and its torques, or a model's errors.

    A robot with its links, frames, centres of mass, gravity, and the torques that hold it; without --q in the middle of
    its joints' ranges. Or, given a recording too, what a calibration model does for one joint: errors over time, close
    up and as a histogram, hysteresis, coverage of the intervals, and delay, as a figure for a paper. --schematic draws
    how cables run, a RAVEN-II's signals and control, which commands drive a robot, or what a model computes.

    Example: catenary plot panda --q-deg 0,-30,0,-120,0,90,45 --base-tilt-deg 0,20 --out panda.png

    Example: catenary plot arm.npz tuesday.parquet --joint elbow --out fig.pdf

    Example: catenary plot raven2 --schematic cables --out cables.svg
    """
    from catenary.reports.robot_plot import middle_pose
    from catenary.reports.robot_plot import plot as draw

    if (log is not None or schematic is not None) and (stated, loaded, joints, hide) != (
        GravityOptions(), LoadedOptions(), JointOptions(), None
    ):  # fmt: skip
        raise InputError(f"plot: options of a robot's picture do not go with {'LOG' if log else '--schematic'}")
    if schematic is not None:
        _plot_schematic(robot, schematic, own, out)
        return
    if log is not None:
        _plot_errors(Path(robot), log, joint, recordings, own, out)
        return
    model = loaded.load(robot)
    gravity = stated.gravity_of(model)
    values = joints.or_none(model)
    pose = middle_pose(model) if values is None else values
    notes = beyond_limits(model, pose) if values is not None else []
    hidden: Any = hide or ()
    if model.missing_inertia and "torques" not in hidden:
        links = ", ".join(model.missing_inertia)
        notes.append(f"no torques: the description gives no mass of {links}")
    print_notes([*notes, *stated.doubts(gravity)])
    figure = draw(model, pose, gravity=gravity, hide=hidden)
    write_picture(figure, out, PICTURE.endings)
    content = {"robot": model.name, "q": pose, "unit": model.joint_units, "gravity": gravity, "out": str(out)}
    print_result(content, f"picture: {out}")


def _plot_schematic(robot: str, kind: str, own: str | None, out: Path) -> None:
    from catenary.calibration.model_file import load_model
    from catenary.reports.schematic import SCHEMATICS, model_schematic
    from catenary.robots.catalog import RAVEN_SIDES, load_robot

    if kind == "model":
        figure = model_schematic(load_model(Path(robot), own)[0])
    else:
        load_robot(robot)  # an unknown name is refused with the choices
        if kind != "commands" and robot not in RAVEN_SIDES:
            raise InputError(f"plot {robot} --schematic {kind}: expected one of {', '.join(RAVEN_SIDES)}")
        figure = SCHEMATICS[kind]()
    write_picture(figure, out, PICTURE.endings)
    print_result({"robot": robot, "schematic": kind, "out": str(out)}, f"picture: {out}")


def _plot_errors(
    path: Path, log: Path, joint: str | None, recordings: ModelRecordingOptions, own: str | None, out: Path
) -> None:
    from catenary.reports.calibration import short_name
    from catenary.reports.joint_errors import model_figure
    from catenary.workflows.calibration_model import held_against

    held = held_against(path, [log], recordings.reading(), own=own)
    result = held.evaluate()
    print_notes(result.notes)
    figure = model_figure(result.evaluation, held.logs[0], joint, name=short_name(result.model))
    write_picture(figure, out, PICTURE.endings)
    content = {"model": str(path), "joint": joint or result.model.joint_names[0], "out": str(out)}
    print_result(content, f"picture: {out}")


def regressor(
    description: DescriptionOptions,
    robot: str = ROBOT,
    compact: bool = option(None, "Print the compact form, with its values.", False),
    latex: bool = option(None, "Print the compact form for LaTeX.", False, not_with="as_json"),
) -> None:
    """Print which masses gravity torques can identify.

    Example: catenary regressor planar_3r --compact
    """
    from catenary.workflows.regressor_report import describe_regressor

    report = describe_regressor(description.load(robot))
    if latex:
        print(report.compact.latex())
        return
    parts = _compact(report) if compact else _identifiability(report)
    print_result(report.as_data(), *parts)


def _compact(report: "RegressorReport") -> list[Any]:
    form = report.compact
    columns: list[Column] = ["", "", ("value", ":.6g"), "unit"]
    names = [f"s{k}" for k in range(1, len(form.labels) + 1)]
    rows = list(zip(names, form.labels, report.compact_values, form.units, strict=True))
    symbols = [
        [name, symbol.meaning, "" if symbol.value is None else symbol.value] for name, symbol in form.symbols.items()
    ]
    return [
        f"{report.model.name}: gravity on a level base, g_c = 9.81 m/s2\n\n{form}\n",
        Table(columns, rows, "Parameters", left_aligned=2),
        Table(columns[:3], symbols, "Symbols", left_aligned=2),
        [("without effect", ", ".join(form.ineffective))] if form.ineffective else None,
    ]


def _identifiability(report: "RegressorReport") -> list[Any]:
    from catenary.gravity.gravity_regressor import standard_labels
    from catenary.workflows.regressor_report import WORDS

    value: Column = ("value", ":.6g")
    names = standard_labels(report.model)
    kinds = ([WORDS[kind] for kind in report.identifiable(base)] for base in ("level", "tilted"))
    units = ["kg" if name.startswith("m(") else "kg m" for name in names]
    rows: list[Any] = list(zip(names, *kinds, report.standard_values, units, strict=True))
    title = f"{report.model.name}: do gravity torques identify masses m, and moments m c in link frames?"
    standard = Table(["parameter", "level base", "tilted base", value, "unit"], rows, title, left_aligned=3)
    rows = [[name, base.count, len(names), base.condition] for name, base in report.bases.items()]
    bases = Table(["base", "combinations", "of", ("condition", ":.3g")], rows, "What torques tell")
    values = zip(report.combinations("level"), report.base_values("level"), strict=True)
    rows = [[f"b{k}", *cells] for k, cells in enumerate(values, 1)]
    combinations = Table(["", "", value], rows, "Combinations on a level base", left_aligned=2)
    return [standard, bases, combinations, *(f"  {sentence}" for sentence in report.sentences())]
