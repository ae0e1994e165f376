"""catenary robots, fk, ik."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from catenary.cli.terminal import numbers, print_json, print_table
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.robots.model import RobotModel
    from catenary.spatial import Pose

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="Catalogue name (see catenary robots) or a URDF, MJCF or TOML file."
    ),
]
Q = Annotated[str | None, typer.Option("--q", metavar="Q,Q,...", help="Joint coordinates in rad and m.")]
QDeg = Annotated[
    str | None, typer.Option("--q-deg", metavar="Q,Q,...", help="Joint coordinates in deg and mm.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON: m, rad, quaternions (w, x, y, z).")]
FrameName = Annotated[str | None, typer.Option("--frame", help="Frame of the robot. [default: its tip]")]
InFrame = Annotated[str, typer.Option("--in", metavar="FRAME", help="Frame that the pose is expressed in.")]


def robots(as_json: AsJson = False) -> None:
    """List the robots that come with the package."""
    from catenary.robots.catalog import load_robot, robot_names

    models = [load_robot(name) for name in robot_names()]
    if as_json:
        print_json(
            [{"name": m.name, "joints": m.joint_names, "units": m.joint_units, "tip": m.tip} for m in models]
        )
        return
    rows = [
        [
            m.name,
            ", ".join(f"{name} [{unit}]" for name, unit in zip(m.joint_names, m.joint_units, strict=True)),
            m.tip,
        ]
        for m in models
    ]
    print_table("Robots", ["name", "joints", "tip"], rows)


def fk(
    robot: Robot,
    q: Q = None,
    q_deg: QDeg = None,
    frame: FrameName = None,
    in_frame: InFrame = "base",
    as_json: AsJson = False,
) -> None:
    """Print the pose of a robot's frame.

    Example: catenary fk raven2_full --q-deg 30,90,400,0,0,0
    """
    from catenary.dynamics.kinematics import relative_pose
    from catenary.robots.catalog import load_robot

    model = load_robot(robot)
    values = joint_values(model, q, q_deg)
    name = model.tip if frame is None else frame
    poses = {
        f: relative_pose(model, values, name, f) for f in (in_frame, *_other_base_frames(model, in_frame))
    }
    if as_json:
        print_json(
            {
                "robot": model.name,
                "q": values.tolist(),
                "unit": model.joint_units,
                "frame": name,
                "in": in_frame,
                **pose_numbers(poses[in_frame]),
                "in_other_frames": {f: pose_numbers(pose) for f, pose in poses.items() if f != in_frame},
            }
        )
        return
    print_table(
        f"{model.name}: pose of {name}", _POSE_HEADER, [_pose_row(f, pose) for f, pose in poses.items()]
    )


def ik(
    robot: Robot,
    position_mm: Annotated[
        str | None, typer.Option("--position-mm", metavar="X,Y,Z", help="Where the frame shall be.")
    ] = None,
    rpy_deg: Annotated[
        str | None,
        typer.Option("--rpy-deg", metavar="R,P,Y", help="How it shall be turned: about fixed x, y, z."),
    ] = None,
    quaternion: Annotated[
        str | None, typer.Option("--quaternion", metavar="W,X,Y,Z", help="How it shall be turned.")
    ] = None,
    q: Annotated[
        str | None,
        typer.Option(
            "--q", metavar="Q,Q,...", help="Start (rad, m); without a position, its pose is the goal."
        ),
    ] = None,
    q_deg: QDeg = None,
    frame: FrameName = None,
    in_frame: InFrame = "base",
    seed: Annotated[int, typer.Option("--seed", help="Of the random starts of a numerical search.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Print the joint coordinates that bring a robot's frame to a pose.

    Example: catenary ik raven2_full --position-mm 25.3,-13.2,-77.9 --rpy-deg 0,0,0
    """
    import numpy as np

    from catenary.dynamics.inverse_kinematics import inverse_kinematics
    from catenary.dynamics.kinematics import relative_pose
    from catenary.robots.catalog import load_robot

    model = load_robot(robot)
    name = model.tip if frame is None else frame
    start = None if q is None and q_deg is None else joint_values(model, q, q_deg)
    if position_mm is None:
        if start is None:
            raise InputError(
                "ik: give the goal with --position-mm, or joints with --q whose pose is the goal"
            )
        if rpy_deg is not None or quaternion is not None:
            raise InputError("ik: an orientation without --position-mm; give both")
        goal = relative_pose(model, start, name, in_frame)
    else:
        goal = _goal(position_mm, rpy_deg, quaternion)
    middle = np.zeros(model.n) if start is None else start
    base_pose = relative_pose(model, middle, in_frame, "base") @ goal
    position_only = position_mm is not None and rpy_deg is None and quaternion is None
    solution = inverse_kinematics(
        model,
        base_pose,
        start,
        frame=name,
        match="position" if position_only else None,
        rng=np.random.default_rng(seed),
    )
    reached = relative_pose(model, solution, name, in_frame)
    if as_json:
        print_json(
            {
                "robot": model.name,
                "q": solution.tolist(),
                "unit": model.joint_units,
                "frame": name,
                "in": in_frame,
                "goal": pose_numbers(goal),
                "reached": pose_numbers(reached),
            }
        )
        return
    rows = [
        [n, f"{v:.9g}", u, *_degrees(v, u)]
        for n, v, u in zip(model.joint_names, solution, model.joint_units, strict=True)
    ]
    print_table(f"{model.name}: joints that bring {name} to the goal", ["joint", "value", "", "", ""], rows)
    print_table("Pose", _POSE_HEADER, [_pose_row("goal", goal), _pose_row("reached", reached)])


def joint_values(model: "RobotModel", q: str | None, q_deg: str | None) -> "Floats":
    """Read joint coordinates from one of the two options, (n,) in rad and m.

    Raises:
        InputError: Neither or both given, or another number of joints.
    """
    import numpy as np

    names = ", ".join(f"{n} [{u}]" for n, u in zip(model.joint_names, model.joint_units, strict=True))
    if (q is None) == (q_deg is None):
        raise InputError(
            f"{model.name}: give its {model.n} joints with --q (rad, m) or --q-deg (deg, mm): {names}"
        )
    option, text = ("--q", q) if q is not None else ("--q-deg", q_deg)
    values = np.array(numbers(option, text or ""))
    if values.shape != (model.n,) or not np.isfinite(values).all():
        raise InputError(f"{option}: expected {model.n} finite numbers for {names}, got {values.tolist()}")
    if q_deg is not None:
        values = np.where(np.array(model.joint_units) == "rad", np.deg2rad(values), values / 1000.0)
    return values


def pose_numbers(pose: "Pose") -> dict[str, Any]:
    """Give a pose as plain data: position [m], quaternion (w, x, y, z), rotation matrix."""
    from catenary.spatial import quaternion_from_rotation

    return {
        "position": pose.position.tolist(),
        "quaternion": quaternion_from_rotation(pose.rotation).tolist(),
        "rotation": pose.rotation.tolist(),
    }


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
    if rpy_deg is not None:
        return Pose(
            rotation_from_rpy(np.deg2rad(as_array("--rpy-deg", numbers("--rpy-deg", rpy_deg), (3,)))),
            position,
        )
    if quaternion is not None:
        return Pose(rotation_from_quaternion(numbers("--quaternion", quaternion)), position)
    return Pose(np.eye(3), position)


def _other_base_frames(model: "RobotModel", shown: str) -> list[str]:
    return [name for name, frame in model.frames.items() if frame.link == -1 and name not in ("base", shown)]


def _degrees(value: float, unit: str) -> list[str]:
    import numpy as np

    return [f"{np.rad2deg(value):.4f}", "deg"] if unit == "rad" else [f"{1000.0 * value:.4f}", "mm"]
