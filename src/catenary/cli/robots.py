"""catenary robots, fk, ik, plot, regressor: what is known of a robot without any recording."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catenary.cli.gravity_options import GivenGravity
from catenary.cli.options import AS_JSON, TABLES_AS_JSON, Names, Numbers, Triple, argument, option
from catenary.cli.out_files import NAMED_AS_TYPED, PICTURE
from catenary.cli.recording_options import ModelRecordingOptions
from catenary.cli.robot_options import (
    Q_DEG,
    ROBOT,
    SAME_IN_DEG,
    DescriptionOptions,
    PayloadOptions,
    Q,
    beyond_limits,
    given_joints,
    joint_values,
)
from catenary.cli.terminal import print_fact, print_json, print_notes, without_notes
from catenary.errors import InputError
from catenary.units import in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from catenary.arrays import Floats
    from catenary.dynamics.inverse_kinematics import Match
    from catenary.reports.page import Table
    from catenary.robots.model import RobotModel
    from catenary.spatial import Pose
    from catenary.workflows.regressor_report import RegressorReport

ROOM_FOR_NAMES = 30  # characters, so that a robot's line fits into a terminal of 80
DOTS_PER_INCH = 150
WITHOUT_WINDOWS = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")  # of matplotlib's ways to draw
POSE_AS_JSON = option(None, "Print JSON: m, rad, quaternions (w, x, y, z).", False, flag="--json")
FRAME_NAME = option("FRAME", "Frame of the robot. [default: its tip]")
IN_FRAME = option("FRAME", "Frame that the pose is expressed in. [default: base]", flag="--in")


def robots(as_json: bool = TABLES_AS_JSON) -> None:
    """List the robots that come with the package."""
    from catenary.robots.catalog import load_robot, robot_names

    with without_notes(True):  # those that a robot has when it is named
        models = [load_robot(name) for name in robot_names()]
    if as_json:
        print_json([{"name": m.name, "joints": m.joint_names, "units": m.joint_units, "tip": m.tip} for m in models])
        return
    from catenary.reports.page import Table, TableColumn

    columns = [
        TableColumn("name", "name"),
        TableColumn("joints", _kinds),
        TableColumn("tip", "tip"),
        TableColumn("joint names", _names_in_brief),
    ]
    print(Table(columns, models, "Robots", left=4).text())
    print("R: revolute, P: prismatic; catenary check ROBOT names joints with their limits")


def _kinds(model: "RobotModel") -> str:
    turning = model.joint_units.count("rad")
    counts = ((turning, "R"), (model.n - turning, "P"))
    return " ".join(f"{count}{kind}" for count, kind in counts if count)


def _names_in_brief(model: "RobotModel") -> str:
    names = ", ".join(model.joint_names)
    return names if len(names) <= ROOM_FOR_NAMES else f"{model.joint_names[0]} ... {model.joint_names[-1]}"


def fk(
    robot: str = ROBOT,
    q: Numbers | None = Q,
    q_deg: Numbers | None = Q_DEG,
    frame: str | None = FRAME_NAME,
    in_frame: str | None = IN_FRAME,
    as_json: bool = POSE_AS_JSON,
) -> None:
    """Print the pose of a robot's frame.

    Example: catenary fk raven2_full --q-deg 30,90,400,0,0,0
    """
    from catenary.dynamics.kinematics import relative_pose
    from catenary.robots.catalog import load_robot

    model = load_robot(robot)
    values = joint_values(model, q, q_deg)
    print_notes(beyond_limits(model, values))
    name, in_frame = frame or model.tip, in_frame or model.base
    shown = {in_frame, "base"} if model.base == "base" else {in_frame}
    resting = [f for f in model.frames if model.frames[f].link < 0 and f not in shown]
    poses = {f: relative_pose(model, values, name, f) for f in (in_frame, *resting)}
    if as_json:
        asked = {"robot": model.name, "q": values, "unit": model.joint_units, "frame": name, "in": in_frame}
        others = {f: pose_numbers(pose) for f, pose in poses.items() if f != in_frame}
        print_json({**asked, **pose_numbers(poses[in_frame]), "in_other_frames": others})
        return
    print(_pose_table("in", poses, f"{model.name}: pose of {name}").text())


def ik(
    robot: str = ROBOT,
    position_mm: Triple | None = option("X,Y,Z", "Position of the frame."),
    rpy_deg: Triple | None = option(
        "R,P,Y", "Orientation of the frame: turned about fixed x, y, z.", goes_with="position_mm", not_with="quaternion"
    ),
    quaternion: tuple[float, float, float, float] | None = option(
        "W,X,Y,Z", "Orientation of the frame.", goes_with="position_mm"
    ),
    q: Numbers | None = option(
        "Q,Q,...", "Joints to start from, in rad and m; without a position, their pose is the goal."
    ),
    q_deg: Numbers | None = SAME_IN_DEG,
    frame: str | None = FRAME_NAME,
    in_frame: str | None = option(
        "FRAME", "Frame, at rest, that the goal is expressed in. [default: base]", flag="--in"
    ),
    seed: int = option("N", "Seed of the random starts, where a search needs several.", 0, least=0),
    as_json: bool = POSE_AS_JSON,
) -> None:
    """Print the joints that bring a robot's frame to a pose.

    Without an orientation, any will do.

    Example: catenary ik raven2 --position-mm 19,-7.4,-67
    """
    import numpy as np

    from catenary.dynamics.inverse_kinematics import inverse_kinematics
    from catenary.dynamics.kinematics import relative_pose
    from catenary.robots.catalog import load_robot

    model = load_robot(robot)
    name, in_frame = frame or model.tip, in_frame or model.base
    start = given_joints(model, q, q_deg)
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
    if as_json:
        asked = {"robot": model.name, "q": solution, "unit": model.joint_units, "frame": name, "in": in_frame}
        unknown = {"quaternion": None, "rotation": None} if match == "position" else {}
        print_json({**asked, "goal": pose_numbers(goal) | unknown, "reached": pose_numbers(reached)})
        return
    from catenary.reports.page import Table

    rows = [
        [n, f"{v:.9g} {u}", in_words(v, u, 4)]
        for n, v, u in zip(model.joint_names, solution, model.joint_units, strict=True)
    ]
    title = f"{model.name}: joints that bring {name} to the goal"
    print(Table(["joint", "", ""], rows, title).text())
    free = "goal" if match == "position" else ""
    print(_pose_table("", {"goal": goal, "reached": reached}, f"Pose in {in_frame}", free=free).text())


def pose_numbers(pose: "Pose") -> dict[str, Any]:
    """Return a pose as plain data: position [m], quaternion (w, x, y, z), rotation matrix."""
    from catenary.spatial import quaternion_from_rotation

    quaternion = quaternion_from_rotation(pose.rotation)
    return {"position": pose.position, "quaternion": quaternion, "rotation": pose.rotation}


def _pose_table(first: str, poses: "dict[str, Pose]", title: str, *, free: str = "") -> "Table":
    """Return a table of poses, a row each; the orientation of the one that is named `free` may be any."""
    from catenary.reports.page import Table, TableColumn

    columns = [
        TableColumn(first),
        *(TableColumn(f"{axis} [mm]", form=".3f") for axis in "xyz"),
        *(TableColumn(part, form=".6f") for part in "wxyz"),
    ]
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
        rotation = rotation_from_rpy(np.deg2rad(as_array("--rpy-deg", rpy_deg, (3,))))
    elif quaternion is not None:
        rotation = rotation_from_quaternion(quaternion)
    return Pose(rotation, as_array("--position-mm", position_mm, (3,)) / 1000.0)


def plot(
    given: GivenGravity,
    description: DescriptionOptions,
    carried: PayloadOptions,
    recordings: ModelRecordingOptions,
    robot: str = replace(ROBOT, metavar="ROBOT|MODEL", help=f"{ROBOT.help} With LOG: a calibration model."),
    log: Path | None = argument("LOG", "A recording: draw the model's errors on it, one column wide.", None),
    joint: str | None = option("NAME", "With LOG: the joint to draw. [default: the first]", goes_with="log"),
    q: Numbers | None = Q,
    q_deg: Numbers | None = Q_DEG,
    workspace: bool = option(None, "Draw where the ends can be, too.", False),
    hide: Names | None = option("PART,...", "What not to draw, of frames, masses, gravity and torques."),
    out: Path | None = option(
        "FILE", f"Picture to write, .png, .svg or .pdf. {NAMED_AS_TYPED} [default: a window]", writes=PICTURE
    ),
    as_json: bool = replace(AS_JSON, goes_with="out"),
) -> None:
    """Draw a robot and its torques, or a model's errors.

    A robot with its links, frames, centres of mass, gravity, and the torques that hold it; without --q in the middle of
    its joints' ranges. Or, given a recording too, what a calibration model does for one joint: errors over time, their
    histogram, hysteresis, coverage of the intervals, and delay, as a figure for a paper.

    Example: catenary plot panda --q-deg 0,-30,0,-120,0,90,45 --base-tilt-deg 0,20 --out panda.png

    Example: catenary plot arm.npz tuesday.parquet --joint elbow --out fig.pdf
    """
    from catenary.reports.page import write_picture
    from catenary.reports.robot_plot import middle_pose
    from catenary.reports.robot_plot import plot as draw

    if log is not None:
        if (given, description, carried, q, q_deg, workspace, hide) != (
            GivenGravity(), DescriptionOptions(), PayloadOptions(), None, None, False, None,
        ):  # fmt: skip
            raise InputError("plot MODEL LOG: options of a robot's picture do not go with LOG")
        _plot_errors(Path(robot), log, joint, recordings, out, as_json=as_json)
        return
    gravity = given.told()
    model = carried.on(description.load(robot))
    values = given_joints(model, q, q_deg)
    pose = middle_pose(model) if values is None else values
    notes = beyond_limits(model, pose) if values is not None else []
    hidden: Any = hide or ()
    if model.missing_inertia and "torques" not in hidden:
        links = ", ".join(model.missing_inertia)
        notes.append(f"no torques: the description gives no mass of {links}")
    print_notes([*notes, *given.doubts(gravity)])
    on = _window(model.name) if out is None else None
    figure = draw(model, pose, gravity=gravity, hide=hidden, workspace=workspace, on=on)
    if out is None:
        _show()
        return
    write_picture(figure, out, PICTURE.endings)
    if as_json:
        print_json({"robot": model.name, "q": pose, "unit": model.joint_units, "gravity": gravity, "out": str(out)})
        return
    print(f"picture: {out}")


def _plot_errors(
    path: Path, log: Path, joint: str | None, recordings: ModelRecordingOptions, out: Path | None, *, as_json: bool
) -> None:
    from catenary.reports.calibration import short_name
    from catenary.reports.model_figure import model_figure
    from catenary.reports.page import write_picture
    from catenary.workflows.calibration_model import held_against

    if out is None:
        raise InputError("plot MODEL LOG: give --out FILE, as fig.pdf")
    held = held_against(path, [log], recordings.reading())
    result = held.evaluate()
    print_notes(result.notes)
    figure = model_figure(result.evaluation, held.logs[0], joint, name=short_name(result.model))
    write_picture(figure, out, PICTURE.endings)
    if as_json:
        print_json({"model": str(path), "joint": joint or result.model.joint_names[0], "out": str(out)})
        return
    print(f"picture: {out}")


def _window(name: str) -> "Figure":
    """Return a figure in a window that is not shown yet."""
    import matplotlib.pyplot as plt

    if plt.get_backend().lower() in WITHOUT_WINDOWS:
        raise InputError("plot: no window can be opened here; give --out FILE, as robot.png")
    return plt.figure(name, figsize=(11.0, 6.0), layout="constrained")


def _show() -> None:
    import matplotlib.pyplot as plt

    plt.show()


def regressor(
    description: DescriptionOptions,
    robot: str = ROBOT,
    compact: bool = option(None, "Print the compact form, with its values.", False),
    latex: bool = option(None, "Print the compact form for LaTeX.", False, not_with="as_json"),
    as_json: bool = option(None, "Print JSON: kg and kg m.", False, flag="--json"),
) -> None:
    """Print which masses gravity torques can identify.

    Example: catenary regressor planar_3r --compact
    """
    from catenary.workflows.regressor_report import describe_regressor

    report = describe_regressor(description.load(robot))
    if as_json:
        print_json(report.as_data())
    elif latex:
        print(report.compact.latex())
    elif compact:
        _print_compact(report)
    else:
        _print_identifiability(report)


def _print_compact(report: "RegressorReport") -> None:
    from catenary.reports.page import Table, TableColumn

    form = report.compact
    print(f"{report.model.name}: gravity on a level base, g_c = 9.81 m/s2\n\n{form}\n")
    columns = [TableColumn(""), TableColumn(""), TableColumn("value", form=".6g"), TableColumn("unit")]
    names = [f"s{k}" for k in range(1, len(form.labels) + 1)]
    values = _known(report.compact_values, len(names))
    rows = list(zip(names, form.labels, values, form.units, strict=True))
    print(Table(columns, rows, "Parameters", left=2).text())
    symbols = [
        [name, symbol.meaning, "" if symbol.value is None else symbol.value] for name, symbol in form.symbols.items()
    ]
    print(Table(columns[:3], symbols, "Symbols", left=2).text())
    if form.ineffective:
        print_fact("without effect", ", ".join(form.ineffective), width=14)


def _print_identifiability(report: "RegressorReport") -> None:
    from catenary.gravity.gravity_regressor import standard_labels
    from catenary.reports.page import Table, TableColumn
    from catenary.workflows.regressor_report import WORDS

    columns = [
        TableColumn("parameter"),
        TableColumn("level base", lambda row: WORDS[row[1]]),
        TableColumn("tilted base", lambda row: WORDS[row[2]]),
        TableColumn("value", form=".6g"),
        TableColumn("unit", lambda row: "kg" if row[0].startswith("m(") else "kg m"),
    ]
    names, kinds = standard_labels(report.model), map(report.identifiable, ("level", "tilted"))
    values = _known(report.standard_values, len(names))
    rows: list[Any] = list(zip(names, *kinds, values, strict=True))
    title = f"{report.model.name}: do gravity torques tell masses m, and moments m c in the links' frames?"
    print(Table(columns, rows, title, left=3).text())
    columns = [
        TableColumn("base"),
        TableColumn("combinations"),
        TableColumn("of"),
        TableColumn("condition number", form=".3g"),
    ]
    rows = [[name, base.count, len(names), base.condition] for name, base in report.bases.items()]
    print(Table(columns, rows, "What torques tell").text())
    labels = report.combinations("level")
    values = _known(report.base_values("level"), len(labels))
    rows = [[f"b{k}", *cells] for k, cells in enumerate(zip(labels, values, strict=True), 1)]
    columns = [TableColumn(""), TableColumn(""), TableColumn("value", form=".6g")]
    print(Table(columns, rows, "Combinations on a level base", left=2).text())
    for sentence in report.sentences():
        name, _, text = sentence.partition(": ")
        print_fact(f"{name}:", text, width=0) if text else print(f"  {sentence}")


def _known(values: "Floats | None", count: int) -> "list[None] | Floats":
    return [None] * count if values is None else values
