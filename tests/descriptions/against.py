"""python -m tests.descriptions.against ROBOT URDF: a robot of the catalogue held against somebody else's file of it.

Gravity torques at random poses between the limits, level and tilted, theirs by Pinocchio from their own file: the
largest difference for every joint in Nm, and over the largest torque. `--without hand,finger` takes links whose names
hold these words out of their file. The table of docs/public-robots.md is made of its lines.
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY

POSES = 1000
Floats = NDArray[np.float64]


def read(path: Path, without: Sequence[str]) -> pin.Model:
    """Return Pinocchio's model of a file, without the masses of links whose names hold certain words."""
    root = ElementTree.parse(path).getroot()
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None and any(word in str(link.get("name")) for word in without):
            link.remove(inertial)
    return pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))


def differences(
    model: RobotModel, theirs: pin.Model, joints: Sequence[int], poses: Iterable[tuple[Floats, Floats]]
) -> tuple[Floats, float]:
    """Return the largest difference (n,) to Pinocchio's torques [Nm], and the largest torque, over poses and gravities.

    joints are Pinocchio's of the tree's links.
    """
    data = theirs.createData()
    worst, largest = np.zeros(model.n), 0.0
    for q, gravity in poses:
        theirs.gravity.linear = gravity
        pose = pin.neutral(theirs)
        for place, joint in zip(model.coupling @ q + model.offset, joints, strict=True):
            k, turns = theirs.joints[joint].idx_q, theirs.joints[joint].nq == 2  # continuous: cosine and sine
            pose[k : k + 1 + turns] = [np.cos(place), np.sin(place)] if turns else [place]
        torque = pin.computeGeneralizedGravity(theirs, data, pose)
        expected = model.coupling.T @ [torque[theirs.joints[joint].idx_v] for joint in joints]
        worst = np.maximum(worst, np.abs(gravity_torque(model, q, gravity) - expected))
        largest = max(largest, float(np.abs(expected).max()))
    return worst, largest


def between_limits(model: RobotModel, rng: np.random.Generator) -> Iterator[tuple[Floats, Floats]]:
    """Yield poses (n,) between the limits, and gravity (3,) in any direction."""
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (model.lower, model.upper))
    for _ in range(POSES):
        q, down = rng.uniform(lower, upper), rng.normal(size=3)
        yield q, STANDARD_GRAVITY * down / np.linalg.norm(down)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print one line."""
    made = argparse.ArgumentParser(prog="python -m tests.descriptions.against", description=__doc__)
    made.add_argument("robot")
    made.add_argument("file", type=Path)
    made.add_argument("--without", default="", help="Words in the names of links to leave out, by commas.")
    told = made.parse_args(arguments)
    words = [word for word in told.without.split(",") if word]
    model = load_robot(told.robot)
    poses = between_limits(model, np.random.default_rng(0))
    worst, largest = differences(model, read(told.file, words), range(1, model.n + 1), poses)
    joints = ", ".join(f"{each:.2g}" for each in worst)
    print(f"| {told.robot} | {told.file.name} | {joints} | {worst.max() / largest:.1g} of {largest:.3g} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
