"""python -m tests.descriptions.against ROBOT URDF: a robot of the catalogue held against somebody else's file of it.

Gravity torques at random poses between the limits, level and tilted, theirs by Pinocchio from their own file: the
largest difference for every joint in Nm, and over the largest torque. `--without hand,finger` takes links whose names
hold these words out of their file. The table of docs/public-robots.md is made of its lines.
"""

import argparse
from collections.abc import Sequence
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


def read(path: Path, without: Sequence[str]) -> pin.Model:
    """Return Pinocchio's model of a file, without the masses of links whose names hold certain words."""
    root = ElementTree.parse(path).getroot()
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None and any(word in str(link.get("name")) for word in without):
            link.remove(inertial)
    return pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))


def differences(model: RobotModel, theirs: pin.Model, rng: np.random.Generator) -> tuple[NDArray[np.float64], float]:
    """Return the largest difference (n,) [Nm] in the first n joints of both, and the largest torque [Nm]."""
    data = theirs.createData()
    lower, upper = (np.clip(limit, -np.pi, np.pi) for limit in (model.lower, model.upper))
    worst, largest = np.zeros(model.n), 0.0
    for _ in range(POSES):
        q, down = rng.uniform(lower, upper), rng.normal(size=3)
        gravity = STANDARD_GRAVITY * down / np.linalg.norm(down)
        theirs.gravity.linear = gravity
        pose = pin.neutral(theirs)
        for place, joint in zip(q, theirs.joints[1:], strict=False):
            k = joint.idx_q
            pose[k : k + joint.nq] = [np.cos(place), np.sin(place)] if joint.nq == 2 else [place]
        torque = pin.computeGeneralizedGravity(theirs, data, pose)
        expected = np.array([torque[joint.idx_v] for joint in theirs.joints[1 : model.n + 1]])
        worst = np.maximum(worst, np.abs(gravity_torque(model, q, gravity) - expected))
        largest = max(largest, float(np.abs(expected).max()))
    return worst, largest


def main(arguments: Sequence[str] | None = None) -> int:
    """Print one line."""
    made = argparse.ArgumentParser(prog="python -m tests.descriptions.against", description=__doc__)
    made.add_argument("robot")
    made.add_argument("file", type=Path)
    made.add_argument("--without", default="", help="Words in the names of links to leave out, by commas.")
    told = made.parse_args(arguments)
    words = [word for word in told.without.split(",") if word]
    worst, largest = differences(load_robot(told.robot), read(told.file, words), np.random.default_rng(0))
    joints = ", ".join(f"{each:.2g}" for each in worst)
    print(f"| {told.robot} | {told.file.name} | {joints} | {worst.max() / largest:.1g} of {largest:.3g} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
