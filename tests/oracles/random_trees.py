"""Random robots: trees of coupled joints with physical bodies; the links are kept for the oracles."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, identity_pose

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RandomRobot:
    """The model, and the links it was assembled from, parents first, for the oracles to start from."""

    model: RobotModel
    links: list[Link]


def random_rotation(rng: np.random.Generator) -> Floats:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def random_inertia(rng: np.random.Generator) -> LinkInertia:
    """A physical body: 12 random point masses of 3 kg in all, some 0.2 m apart."""
    points = rng.normal(scale=0.2, size=(12, 3))
    masses = rng.uniform(0.1, 0.4, size=12)
    com = masses @ points / masses.sum()
    r = points - com
    tensor = np.einsum("k,k->", masses, (r * r).sum(axis=1)) * np.eye(3) - np.einsum("k,ki,kj->ij", masses, r, r)
    return LinkInertia(float(masses.sum()), com, tensor)


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(random_rotation(rng), rng.normal(scale=0.3, size=3))


def random_robot(seed: int) -> RandomRobot:
    """1 to 9 moving joints in a tree, prismatic and coupled ones among them, and fixed links in between."""
    rng = np.random.default_rng(seed)
    n_moving = 1 + seed % 9
    links: list[Link] = []
    coordinates: list[Coordinate] = []
    for i in range(n_moving):
        kind = "prismatic" if rng.random() < 0.3 else "revolute"
        variable: dict[str, float] = {}
        own = i == 0 or rng.random() < 0.75
        earlier = [c.name for c in coordinates]
        if own:
            variable[f"q{i}"] = float(rng.choice([1.0, -1.0, rng.uniform(0.5, 2.0)]))
            coordinates.append(Coordinate(f"q{i}", "m" if kind == "prismatic" else "rad"))
        # a mimic joint follows earlier coordinates; a combination adds them to its own
        if earlier and (not own or rng.random() < 0.2):
            for name in rng.choice(earlier, size=min(len(earlier), 1 + int(rng.random() < 0.5)), replace=False):
                variable[str(name)] = float(rng.uniform(-1.0, 1.0))
        parents = ["base", *(link.name for link in links)]
        # a chain more often than not, and branches
        parent = parents[-1] if rng.random() < 0.6 else str(rng.choice(parents))
        links.append(
            Link(
                name=f"link{i}",
                parent=parent,
                joint=kind,
                pose=random_pose(rng),
                axis=np.eye(3)[rng.integers(3)] if rng.random() < 0.4 else rng.normal(size=3),
                variable=variable,
                offset=float(rng.normal(scale=0.3)) if rng.random() < 0.3 else 0.0,
                frame=random_pose(rng) if rng.random() < 0.4 else identity_pose(),
                inertia=random_inertia(rng),
            )
        )
        if rng.random() < 0.25:
            links.append(Link(f"fixed{i}", links[-1].name, "fixed", random_pose(rng), inertia=random_inertia(rng)))
    order = rng.permutation(len(links))
    model = assemble(f"random{seed}", [links[k] for k in order], coordinates)
    return RandomRobot(model, links)


def random_bodies_on(model: RobotModel, rng: np.random.Generator) -> RandomRobot:
    """A known robot's joints with random bodies on them, massless links included."""
    tree = model.tree
    links = [
        Link(
            name=name,
            parent="base" if tree.parent[i] < 0 else model.link_names[tree.parent[i]],
            joint="prismatic" if tree.prismatic[i] else "revolute",
            pose=Pose(tree.rotation[i], tree.origin[i]),
            axis=tree.axis[i],
            variable={
                joint: float(factor)
                for joint, factor in zip(model.joint_names, model.coupling[i], strict=True)
                if factor != 0.0
            },
            offset=float(model.offset[i]),
            inertia=random_inertia(rng),
        )
        for i, name in enumerate(model.link_names)
    ]
    coordinates = [Coordinate(*pair) for pair in zip(model.joint_names, model.joint_units, strict=True)]
    return RandomRobot(assemble(model.name, links, coordinates, actuation=model.actuation), links)
