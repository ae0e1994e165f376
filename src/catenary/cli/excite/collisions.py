"""Options of what a motion must not hit, and how they are read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.terminal import numbers
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.robots.geometry import Shape
    from catenary.robots.model import RobotModel
    from catenary.workflows.excitation import MotionSurroundings


@dataclass(frozen=True)
class CollisionOptions:
    """What stands about the robot, and what its own links look like."""

    floor_m: Annotated[
        float | None, Option(metavar="Z", help="Height of the floor in the base frame, which has z up.")
    ] = None
    box: Annotated[
        list[str] | None,
        Option(
            metavar="X,Y,Z,DX,DY,DZ", help="A box: its centre and its edges, m in the base frame; repeatable."
        ),
    ] = None
    mesh: Annotated[
        list[str] | None,
        Option(
            metavar="FILE[@X,Y,Z]", help="A mesh in m, its origin at a place in the base frame; repeatable."
        ),
    ] = None
    margin_mm: Annotated[float, Option(metavar="MM", help="Distance that everything keeps at least.")] = 10.0
    link_radius_mm: Annotated[
        float | None,
        Option(
            metavar="MM",
            help="Capsules of this radius along the links, in place of what the robot's description shows.",
        ),
    ] = None
    package_dir: Annotated[
        list[Path] | None,
        Option(
            metavar="FOLDER", help="Where a ROS package of meshes lies; repeatable. [default: above the URDF]"
        ),
    ] = None
    may_touch: Annotated[
        list[str] | None,
        Option(metavar="A:B", help="Two links, or a link and an obstacle, not to compare; repeatable."),
    ] = None
    no_collision_check: Annotated[
        bool, Option("--no-collision-check", help="Design without looking at what the robot hits.")
    ] = False

    def around(self, robot: str, model: "RobotModel") -> "MotionSurroundings":
        """Return what a robot must not hit."""
        from catenary.robots.shapes import load_geometry
        from catenary.workflows.excitation import MotionSurroundings

        if not 0.0 < self.margin_mm <= 1000.0:
            raise InputError(f"--margin-mm: expected above 0 and at most 1000 mm, got {self.margin_mm:g}")
        obstacles = self._obstacles()
        if self.no_collision_check:
            if obstacles:
                raise InputError(
                    "--no-collision-check: expected none of --floor-m, --box and --mesh beside it"
                )
            return MotionSurroundings(None, unchecked="as --no-collision-check says")
        radius = None if self.link_radius_mm is None else 1e-3 * self.link_radius_mm
        geometry = load_geometry(robot, model, packages=self.package_dir or (), link_radius=radius)
        return MotionSurroundings(
            geometry,
            obstacles,
            1e-3 * self.margin_mm,
            tuple(self._pair(text) for text in self.may_touch or ()),
            f"{model.name} has no shapes, and no masses that tell how thick its links are: give --link-radius-mm MM",
        )

    def _obstacles(self) -> "tuple[Shape, ...]":
        from catenary.collision.bodies import box_at, floor_at, mesh_at

        found = [] if self.floor_m is None else [floor_at(self.floor_m)]
        found += [box_at(k, numbers("--box", text, 6)) for k, text in enumerate(self.box or (), start=1)]
        for text in self.mesh or ():
            name, _, place = text.rpartition("@")
            if not name:
                name, place = text, "0,0,0"
            found.append(mesh_at(Path(name), numbers("--mesh", place, 3)))
        return tuple(found)

    @staticmethod
    def _pair(text: str) -> tuple[str, str]:
        first, _, second = text.partition(":")
        if not first or not second:
            raise InputError(f"--may-touch: expected two names, such as upper_arm_link:floor, got {text!r}")
        return first, second
