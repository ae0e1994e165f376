"""python -m tests.descriptions FOLDER [--version TEXT]: every URDF below a folder, loaded and held against Pinocchio.

Prints the table of docs/robots.md: per file its joints and mass, and how far gravity torques are from Pinocchio's at
random poses under random gravity, relative to the largest; or why it is refused. example-robot-data comes by
`pip download --no-deps example-robot-data==VERSION` and `python -m zipfile -e *.whl FOLDER`.
"""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from catenary.errors import CatenaryError
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from tests.descriptions.against import differences

POSES = 5
BOUND = 1e-10


def difference(path: Path, model: RobotModel, rng: np.random.Generator) -> float:
    """Return the largest difference to Pinocchio's torques over the largest torque, over random poses."""
    theirs = pin.buildModelFromUrdf(str(path))
    tree = ElementTree.parse(path).getroot()
    joint_of = {each.find("child").get("link"): each.get("name") for each in tree.findall("joint")}
    joints = [theirs.getJointId(joint_of[link]) for link in model.link_names]
    poses = ((rng.uniform(-1.0, 1.0, model.n), rng.normal(size=3) * 6.0) for _ in range(POSES))
    worst, largest = differences(model, theirs, joints, poses)
    return float(worst.max()) / (largest or 1.0)


def row(path: Path, name: str, rng: np.random.Generator) -> tuple[str, bool]:
    """Return a file's row, and whether its torques are Pinocchio's."""
    try:
        model = load_robot(path)
        model.require_masses()
        off = difference(path, model, rng)
    except CatenaryError as error:
        why = " ".join(str(error).replace(str(path), "").strip(": ").split())
        return f"| {name} | - | - | refused: {why if len(why) < 160 else why[:157] + '...'} |", False
    doubts = f"; {len(model.doubts)} doubts" if model.doubts else ""
    return f"| {name} | {model.n} | {model.tree.mass.sum():.3g} | {off:.0e}{doubts} |", off < BOUND


def _name(path: Path) -> str:
    """Return a file's name, behind the folder of its robot."""
    parts = path.parts
    return "/".join([*parts[parts.index("robots") + 1 :][:1], path.name]) if "robots" in parts[:-1] else path.name


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; the exit code is 1 where a model that loads has other torques than Pinocchio's."""
    made = argparse.ArgumentParser(prog="python -m tests.descriptions", description=__doc__)
    made.add_argument("folder", type=Path)
    made.add_argument("--version", default="", help="What the folder holds, for the heading.")
    told = made.parse_args(arguments)
    logging.getLogger("catenary").setLevel(logging.ERROR)  # doubts are in the table
    rng = np.random.default_rng(0)
    files = sorted(told.folder.rglob("*.urdf"))
    rows = [row(path, _name(path.relative_to(told.folder)), rng) for path in files]
    agreeing = sum(agrees for _, agrees in rows)
    print(f"{told.version}: {agreeing} of {len(files)} URDFs agree with Pinocchio {pin.__version__} to {BOUND:g}.\n")
    print("| file | joints | moving mass kg | difference to Pinocchio |\n|---|---|---|---|")
    print("\n".join(text for text, _ in rows))
    return int(any(not agrees and "refused" not in text for text, agrees in rows))


if __name__ == "__main__":
    sys.exit(main())
