"""python -m tests.descriptions.collisions MOTION.npz ROBOT: a motion held against Pinocchio's own collision check.

At 10,000 samples, unless told, along the motion that `catenary excitation` designed: the robot's shapes by Pinocchio's
reader of the URDF (or its capsules, for a robot of the catalogue), all pairs of them but those of neighbours, and a
floor. Prints how many samples collide, and how near the nearest comes (of every twentieth).
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from catenary.robots.catalog import load_robot
from catenary.robots.geometry import Capsule, Geometry
from catenary.robots.model import RobotModel
from catenary.robots.shapes import load_geometry
from catenary.robots.urdf_export import urdf_text

BETWEEN = 10_000


def read_geometry(path: Path) -> tuple[pin.Model, pin.GeometryModel]:
    """Return Pinocchio's model of a URDF and of its collision shapes, whose packages are folders above it."""
    model = pin.buildModelFromUrdf(str(path))
    folders = [str(folder) for folder in path.absolute().parents]
    return model, pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=folders)


def of_capsules(robot: RobotModel, shapes: Geometry, folder: Path) -> tuple[pin.Model, pin.GeometryModel]:
    """Return Pinocchio's model of a robot of the catalogue, by its exported URDF, and of its capsules."""
    (folder / "robot.urdf").write_text(urdf_text(robot), "utf-8")
    model = pin.buildModelFromUrdf(str(folder / "robot.urdf"))
    geometry = pin.GeometryModel()
    for k, shape in enumerate(shapes.shapes):
        assert isinstance(shape.form, Capsule)
        joint, at = 0, pin.SE3(shape.pose.rotation, shape.pose.position)
        if shape.link >= 0:
            frame = model.frames[model.getFrameId(robot.link_names[shape.link], pin.FrameType.BODY)]
            joint, at = frame.parentJoint, frame.placement * at
        geometry.addGeometryObject(pin.GeometryObject(f"{shape.name} {k}", joint, at, coal.Capsule(*shape.form)))
    return model, geometry


def with_pairs(model: pin.Model, geometry: pin.GeometryModel, floor: float | None) -> pin.GeometryModel:
    """Add a floor, and all pairs of shapes but those of one link, of neighbours, and of the base with the floor."""
    if floor is not None:
        below = coal.Halfspace(np.array([0.0, 0.0, 1.0]), floor)
        geometry.addGeometryObject(pin.GeometryObject("floor", 0, pin.SE3.Identity(), below))
    objects = geometry.geometryObjects
    shaped = {one.parentJoint for one in objects}
    for i, a in enumerate(objects):
        for j, b in enumerate(objects[:i]):
            first, second = sorted((a.parentJoint, b.parentJoint))
            floors = "floor" in (a.name, b.name)
            if first != second and (floors or _carrier(model, second, shaped) != first):
                geometry.addCollisionPair(pin.CollisionPair(j, i))
    return geometry


def _carrier(model: pin.Model, joint: int, shaped: set[int]) -> int:
    """Return the next joint towards the base whose link has a shape."""
    joint = model.parents[joint]
    while joint and joint not in shaped:
        joint = model.parents[joint]
    return int(joint)


def colliding(model: pin.Model, geometry: pin.GeometryModel, q: NDArray[np.float64]) -> tuple[int, float, str]:
    """Return how many of configurations (N, n) collide, and the smallest distance of all, and of which pair."""
    data, shapes = model.createData(), geometry.createData()
    hits, least, pair = 0, np.inf, ""
    for k, row in enumerate(q):
        pin.updateGeometryPlacements(model, data, geometry, shapes, row)
        hits += pin.computeCollisions(geometry, shapes, True)
        if k % 20 == 0:  # distances of meshes take long
            pin.computeDistances(geometry, shapes)
            found = [one.min_distance for one in shapes.distanceResults]
            nearest = int(np.argmin(found))
            if found[nearest] < least:
                least = found[nearest]
                both = geometry.collisionPairs[nearest]
                pair = " and ".join(geometry.geometryObjects[i].name for i in (both.first, both.second))
    return hits, least, pair


def between(path: Path, samples: int) -> NDArray[np.float64]:
    """Return configurations (samples, n) along a motion in a file, by cubics through its rows."""
    with np.load(path, allow_pickle=False) as file:
        t, q, qd = file["t"], file["q"], file["dq"]
    times = np.linspace(t[0], t[-1], samples)
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    h = (t[k + 1] - t[k])[:, None]
    s = ((times - t[k])[:, None]) / h
    cubic = (2 * s**3 - 3 * s**2 + 1) * q[k] + (s**3 - 2 * s**2 + s) * h * qd[k]
    return np.asarray(cubic + (3 * s**2 - 2 * s**3) * q[k + 1] + (s**3 - s**2) * h * qd[k + 1])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was found; the exit code is 1 where a sample collides."""
    made = argparse.ArgumentParser(prog="python -m tests.descriptions.collisions", description=__doc__)
    made.add_argument("motion", type=Path)
    made.add_argument("robot", help="URDF, or name in the catalogue.")
    made.add_argument("--floor-m", type=float)
    made.add_argument("--samples", type=int, default=BETWEEN)
    told = made.parse_args(arguments)
    if told.robot.endswith(".urdf"):
        model, geometry = read_geometry(Path(told.robot))
    else:
        robot = load_robot(told.robot)
        shapes = load_geometry(told.robot, robot)
        assert shapes is not None
        with TemporaryDirectory() as folder:
            model, geometry = of_capsules(robot, shapes, Path(folder))
    geometry = with_pairs(model, geometry, told.floor_m)
    hits, least, pair = colliding(model, geometry, between(told.motion, told.samples))
    print(
        f"{hits} of {told.samples} samples collide, {len(geometry.collisionPairs)} pairs by Pinocchio {pin.__version__}; "
        f"nearest {pair}: {1000 * least:.1f} mm"
    )
    return int(hits > 0)


if __name__ == "__main__":
    raise SystemExit(main())
