"""catenary robots, fk, ik."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from catenary.cli.joint_options import (
    Q,
    QDeg,
    SameInDeg,
    beyond_limits,
    given_joints,
    joint_values,
)
from catenary.cli.options import AsJsonNotTables, robots_beginning
from catenary.cli.terminal import numbers, print_json, print_notes, print_table, without_notes, words
from catenary.errors import InputError
from catenary.units import in_words

if TYPE_CHECKING:
    from catenary.dynamics.inverse_kinematics import Match
    from catenary.robots.model import Massless, RobotModel
    from catenary.spatial import Pose

ROOM_FOR_NAMES = 30  # characters, so that a robot's line fits into a terminal of 80
Robot = Annotated[
    str,
    Argument(
        metavar="ROBOT",
        help="Catalogue name (see catenary robots), a URDF, MJCF or TOML file, or an identified .npz.",
        autocompletion=robots_beginning,
    ),
]


@dataclass(frozen=True)
class DescriptionOptions:
    """Options of a robot's description that is not complete, or not possible."""

    massless: Annotated[
        str | None,
        Option(
            metavar="LINK,...",
            help="These links have no mass, though the description gives them none: names, or all.",
        ),
    ] = None
    strict: Annotated[
        bool, Option("--strict", help="Refuse inertias that no body has, instead of a warning.")
    ] = False

    def declared(self) -> "Massless":
        """Return which links are declared massless."""
        if self.massless is None:
            return ()
        return "all" if self.massless == "all" else words(self.massless)

    def load(self, robot: str) -> "RobotModel":
        """Return the robot of a name or a file."""
        from catenary.robots.catalog import load_robot

        return load_robot(robot, massless=self.declared(), strict=self.strict)


AsJson = Annotated[bool, Option("--json", help="Print JSON: m, rad, quaternions (w, x, y, z).")]
FrameName = Annotated[
    str | None, Option("--frame", metavar="FRAME", help="Frame of the robot. [default: its tip]")
]
InFrame = Annotated[
    str | None,
    Option("--in", metavar="FRAME", help="Frame that the pose is expressed in. [default: base]"),
]


def robots(as_json: AsJsonNotTables = False) -> None:
    """List the robots that come with the package."""
    from catenary.robots.catalog import load_robot, robot_names

    with without_notes(True):  # those that a robot has when it is named
        models = [load_robot(name) for name in robot_names()]
    if as_json:
        print_json(
            [{"name": m.name, "joints": m.joint_names, "units": m.joint_units, "tip": m.tip} for m in models]
        )
        return
    rows = [[m.name, _kinds(m), m.tip, _names_in_brief(m)] for m in models]
    print_table("Robots", ["name", "joints", "tip", "joint names"], rows, left=4)
    print("R: revolute, P: prismatic; catenary check ROBOT names joints with their limits")


def _kinds(model: "RobotModel") -> str:
    turning = model.joint_units.count("rad")
    counts = ((turning, "R"), (model.n - turning, "P"))
    return " ".join(f"{count}{kind}" for count, kind in counts if count)


def _names_in_brief(model: "RobotModel") -> str:
    names = ", ".join(model.joint_names)
    return names if len(names) <= ROOM_FOR_NAMES else f"{model.joint_names[0]} ... {model.joint_names[-1]}"


def fk(
    robot: Robot,
    q: Q = None,
    q_deg: QDeg = None,
    frame: FrameName = None,
    in_frame: InFrame = None,
    as_json: AsJson = False,
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
    rows = [_pose_row(f, pose) for f, pose in poses.items()]
    print_table(f"{model.name}: pose of {name}", _POSE_HEADER, rows)


def ik(
    robot: Robot,
    position_mm: Annotated[str | None, Option(metavar="X,Y,Z", help="Position of the frame.")] = None,
    rpy_deg: Annotated[
        str | None, Option(metavar="R,P,Y", help="Orientation of the frame: turned about fixed x, y, z.")
    ] = None,
    quaternion: Annotated[str | None, Option(metavar="W,X,Y,Z", help="Orientation of the frame.")] = None,
    q: Annotated[
        str | None,
        Option(
            metavar="Q,Q,...",
            help="Joints to start from, in rad and m; without a position, their pose is the goal.",
        ),
    ] = None,
    q_deg: SameInDeg = None,
    frame: FrameName = None,
    in_frame: Annotated[
        str | None,
        Option(
            "--in", metavar="FRAME", help="Frame, at rest, that the goal is expressed in. [default: base]"
        ),
    ] = None,
    seed: Annotated[
        int, Option(metavar="N", min=0, help="Seed of the random starts, where a search needs several.")
    ] = 0,
    as_json: AsJson = False,
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
        if rpy_deg is not None or quaternion is not None:
            raise InputError("ik: an orientation without --position-mm; give both")
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
        free = {"quaternion": None, "rotation": None} if match == "position" else {}
        print_json({**asked, "goal": pose_numbers(goal) | free, "reached": pose_numbers(reached)})
        return
    rows = [
        [n, f"{v:.9g} {u}", in_words(v, u, 4)]
        for n, v, u in zip(model.joint_names, solution, model.joint_units, strict=True)
    ]
    print_table(f"{model.name}: joints that bring {name} to the goal", ["joint", "", ""], rows)
    goal_row = _pose_row("goal", goal)
    if match == "position":
        goal_row[4:] = ["any"] * 4
    print_table(f"Pose in {in_frame}", ["", *_POSE_HEADER[1:]], [goal_row, _pose_row("reached", reached)])


def pose_numbers(pose: "Pose") -> dict[str, Any]:
    """Return a pose as plain data: position [m], quaternion (w, x, y, z), rotation matrix."""
    from catenary.spatial import quaternion_from_rotation

    quaternion = quaternion_from_rotation(pose.rotation)
    return {"position": pose.position, "quaternion": quaternion, "rotation": pose.rotation}


_POSE_HEADER = ["in", "x [mm]", "y [mm]", "z [mm]", "w", "x", "y", "z"]


def _pose_row(name: str, pose: "Pose") -> list[str]:
    from catenary.spatial import quaternion_from_rotation

    return [
        name,
        *(f"{1000.0 * v:.3f}" for v in pose.position),
        *(f"{v:.6f}" for v in quaternion_from_rotation(pose.rotation)),
    ]


def _goal(position_mm: str, rpy_deg: str | None, quaternion: str | None) -> "Pose":
    import numpy as np

    from catenary.arrays import as_array
    from catenary.spatial import Pose, rotation_from_quaternion, rotation_from_rpy

    if rpy_deg is not None and quaternion is not None:
        raise InputError("ik: give one of --rpy-deg and --quaternion")
    position = as_array("--position-mm", numbers("--position-mm", position_mm), (3,)) / 1000.0
    rotation = np.eye(3)
    if rpy_deg is not None:
        rotation = rotation_from_rpy(np.deg2rad(as_array("--rpy-deg", numbers("--rpy-deg", rpy_deg), (3,))))
    elif quaternion is not None:
        rotation = rotation_from_quaternion(numbers("--quaternion", quaternion))
    return Pose(rotation, position)
