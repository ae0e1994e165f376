"""catenary excitation: a motion that shows an arm's dynamics, within its limits, that hits nothing."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from catenary.cli.gravity_options import GRAVITY
from catenary.cli.identify import IN_PLACE_OF_GRAVITY, gravity_vector
from catenary.cli.options import AS_JSON, REQUIRED, Numbers, Six, Triple, argument, group, numbers, option
from catenary.cli.out_files import EXCITATION, NAMED_AS_TYPED, TRAJECTORY
from catenary.cli.robot_options import DescriptionOptions, PayloadOptions
from catenary.cli.terminal import print_notes, print_result
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.robots.model import RobotModel
    from catenary.workflows.excitation import MotionSurroundings

Touching = tuple[str, str]
Placed = tuple[Path, Numbers]
_UNCHECKED = "no_collision_check"


def _placed_mesh(text: str) -> tuple[Path, Numbers]:
    name, _, place = text.rpartition("@")
    return (Path(name), numbers(place, 3)) if name else (Path(text), (0.0, 0.0, 0.0))


def _pair(text: str) -> tuple[str, str]:
    first, _, second = text.partition(":")
    if not first or not second:
        raise typer.BadParameter(f"expected two names, such as upper_arm_link:floor, got {text!r}")
    return first, second


@group
class CollisionOptions:
    """What stands about the robot, and what its own links look like."""

    floor_m: float | None = option("Z", "Height of the floor in the base frame, z up.", not_with=_UNCHECKED)
    box: Sequence[Six] = option("X,Y,Z,DX,DY,DZ", "A box's centre and edges, m; repeatable.", not_with=_UNCHECKED)
    mesh: Sequence[Placed] = option("FILE[@X,Y,Z]", "A mesh in m; repeatable.", read=_placed_mesh, not_with=_UNCHECKED)
    margin_mm: float = option("MM", "Smallest distance between bodies.", 10.0)
    link_radius_mm: float | None = option("MM", "Take capsules of this radius along the links as their shapes.")
    package_dir: Sequence[Path] = option("FOLDER", "ROS package with meshes; repeatable. [default: above the URDF]")
    may_touch: Sequence[Touching] = option("A:B", "Pair of links or obstacles to ignore; repeatable.", read=_pair)
    no_collision_check: bool = option(None, "Design without a collision check.", False)

    def around(self, robot: str, model: "RobotModel") -> "MotionSurroundings":
        """Return what a robot must not hit."""
        from catenary.collision.bodies import box_at, floor_at, mesh_at
        from catenary.robots.shapes import load_geometry
        from catenary.workflows.excitation import MotionSurroundings

        if not 0.0 < self.margin_mm <= 1000.0:
            raise InputError(f"--margin-mm: expected above 0 and at most 1000 mm, got {self.margin_mm:g}")
        if self.no_collision_check:
            return MotionSurroundings(None, unchecked="as --no-collision-check says")
        obstacles = [] if self.floor_m is None else [floor_at(self.floor_m)]
        obstacles += [box_at(k, place) for k, place in enumerate(self.box, start=1)]
        obstacles += [mesh_at(name, place) for name, place in self.mesh]
        radius = None if self.link_radius_mm is None else 1e-3 * self.link_radius_mm
        return MotionSurroundings(
            load_geometry(robot, model, packages=self.package_dir, link_radius=radius),
            tuple(obstacles),
            1e-3 * self.margin_mm,
            tuple(self.may_touch),
            f"{model.name} has no shapes, and no masses that tell how thick its links are: give --link-radius-mm MM",
        )


@group
class LimitOptions:
    """Limits to keep, narrower than the robot's own or in their place where it has none."""

    lower: Numbers | None = option("Q,Q,...", "Lower limits to keep, rad and m.")
    upper: Numbers | None = option("Q,Q,...", "Upper limits to keep, rad and m.")
    velocity: Numbers | None = option("V,V,...", "Limits of velocity to keep, rad/s and m/s.")
    acceleration: Numbers | None = option("A,A,...", "Limits of acceleration to keep, rad/s2 and m/s2. [default: none]")
    effort: Numbers | None = option("T,T,...", "Limits of torque to keep, Nm and N. [default: the robot's]")


def excitation(
    description: DescriptionOptions,
    carried: PayloadOptions,
    limits: LimitOptions,
    collisions: CollisionOptions,
    robot: str = argument("ROBOT", "Catalogue name or file; needs no inertia."),
    out: Path = option(
        "FILE", f"File to write t, q, dq, ddq to, .npz or .csv. {NAMED_AS_TYPED}", REQUIRED, writes=EXCITATION
    ),
    trajectory: Path | None = option(
        "FILE", "Also write a ROS JointTrajectory, .json or .yaml.", writes=TRAJECTORY, not_with="static"
    ),
    ros: int = option("1|2", "ROS that --trajectory is for.", 2, goes_with="trajectory"),
    static: int | None = option("N", "N poses to hold, in place of one period of a Fourier motion.", least=1),
    period: float = option("S", "Period of the motion.", 10.0, flag="--period-s"),
    harmonics: int = option("N", "Harmonics of the motion, 3 or more.", 5),
    rate: float = option("F", "Rows of the motion per second.", 200.0, flag="--rate-hz"),
    trials: int = option("N", "Motions to choose from; more trials find a better one.", 300, least=1),
    gravity: Triple | None = GRAVITY,
    imu_reading: Triple | None = IN_PLACE_OF_GRAVITY,
    seed: int = option("N", "Seed of everything random.", 0, least=0),
    as_json: bool = AS_JSON,
) -> None:
    """Design a motion to identify an arm from; moves nothing.

    It keeps the arm's limits and hits nothing; --static designs poses to hold.

    Example: catenary excitation panda --floor-m 0 --out motion.csv
    """
    import numpy as np

    from catenary.identification.motion_limits import room_of
    from catenary.workflows.excitation import design_excitation, write_excitation, write_trajectory

    model = carried.on(description.load(robot))
    given = vars(limits).copy()
    if static is not None and given["velocity"] is None:
        given["velocity"] = (1.0,) * model.n  # poses are held: how fast they are reached is the robot's
    room = room_of(model, **given)
    around = collisions.around(robot, model)
    result = design_excitation(
        model, room, around, np.random.default_rng(seed), gravity=np.array(gravity_vector(gravity, imu_reading)),
        static=static, period=period, harmonics=harmonics, rate=rate, trials=trials,
    )  # fmt: skip
    design = result.design
    write_excitation(design, model, out)
    if trajectory is not None:
        write_trajectory(design, model.joint_names, trajectory, ros=ros)
    print_notes([note for note in result.notes if not as_json or note.startswith("warning: ")])
    files = {"file": str(out), **({} if trajectory is None else {"trajectory": str(trajectory)})}
    what = "poses" if design.terms == "static" else f"rows, {design.time[-1]:g} s"
    parts: list[Any] = [
        f"{model.name}: {len(design.q)} {what}",
        f"condition: {design.condition:.4g} for {design.base.count} base parameters",
        *result.kept(),
    ]
    lines = [f"{name}: {path}" for name, path in files.items()]
    print_result(as_json, {**result.summary(), "seed": seed, **files}, *parts, *lines)
