"""Robots to measure on, and the same robots in Pinocchio."""

import numpy as np
import pinocchio

from catenary import RobotModel, load_robot
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.spatial import Pose
from tests.oracles.random_trees import RandomRobot, random_inertia

# modified DH of the Franka Panda (Franka Emika, Robot and interface specifications): a [m], d [m], alpha [deg]
PANDA = (
    (0, 0.333, 0), (0, 0, -90), (0, 0.316, 90), (0.0825, 0, 90), (-0.0825, 0.384, -90), (0, 0, 90), (0.088, 0, 90),
)  # fmt: skip
TORSO = ((0, 0.4, 0), (0, 0, -90), (0.3, 0, 0), (0.3, 0, 90), (0, 0.2, -90))


def robots() -> dict[str, RandomRobot]:
    """Return RAVEN-II's three joints, a Panda-like arm of seven, and a torso of five with two of those."""
    rng = np.random.default_rng(0)
    panda = _chain("joint", "base", PANDA, rng)
    torso = _chain("torso", "base", TORSO, rng)
    left = _chain("left", "torso5", PANDA, rng, shift=0.2)
    right = _chain("right", "torso5", PANDA, rng, shift=-0.2)
    return {
        "raven2, 3 joints": RandomRobot(load_robot("raven2"), []),
        "Panda-like, 7 joints": _robot("panda_like", panda),
        "torso and two arms, 19 joints": _robot("dual_arm_like", torso + left + right),
    }


def pinocchio_robot(model: RobotModel) -> pinocchio.Model:
    """Build a model whose coordinates are its tree's in Pinocchio; joints along z become its quick aligned ones."""
    tree = model.tree
    assert (model.coupling == np.eye(model.n)).all()
    assert not model.offset.any()
    pin = pinocchio.Model()
    for i, name in enumerate(model.link_names):
        if (tree.axis[i] == [0.0, 0.0, 1.0]).all():
            joint = pinocchio.JointModelPZ() if tree.prismatic[i] else pinocchio.JointModelRZ()
        else:
            kind = "Prismatic" if tree.prismatic[i] else "Revolute"
            joint = getattr(pinocchio, f"JointModel{kind}Unaligned")(tree.axis[i])
        pose = pinocchio.SE3(tree.rotation[i], tree.origin[i])
        added = pin.addJoint(int(tree.parent[i]) + 1, joint, pose, name)
        body = pinocchio.Inertia(tree.mass[i], tree.com[i], tree.inertia[i])
        pin.appendBodyToJoint(added, body, pinocchio.SE3.Identity())
    return pin


def _chain(
    name: str, root: str, rows: tuple[tuple[float, float, float], ...], rng: np.random.Generator, shift: float = 0.0
) -> list[Link]:
    links: list[Link] = []
    for k, (a, d, alpha_deg) in enumerate(rows):
        alpha = np.deg2rad(alpha_deg)
        R = np.round([[1, 0, 0], [0, np.cos(alpha), -np.sin(alpha)], [0, np.sin(alpha), np.cos(alpha)]])
        origin = np.array([a, shift if k == 0 else 0.0, 0.0]) + R @ [0.0, 0.0, d]
        links.append(
            Link(
                name=f"{name}{k + 1}",
                parent=links[-1].name if links else root,
                joint="revolute",
                pose=Pose(R, origin),
                axis=np.array([0.0, 0.0, 1.0]),
                variable={f"{name}{k + 1}": 1.0},
                inertia=random_inertia(rng),
            )
        )
    return links


def _robot(name: str, links: list[Link]) -> RandomRobot:
    return RandomRobot(assemble(name, links, [Coordinate(link.name, "rad") for link in links]), links)
