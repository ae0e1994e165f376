"""Random robot descriptions, as XML text, for comparison with other readers of the same text."""

import numpy as np


def numbers(values) -> str:
    return " ".join(f"{v:.15g}" for v in np.atleast_1d(values))


def random_tensor(rng, size=0.1):
    """Inertia of a cloud of points about its centre: any cloud gives a tensor that a body can have."""
    points = rng.normal(scale=size, size=(6, 3))
    points -= points.mean(axis=0)
    return sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)


def random_urdf(rng, *, kinds, mimics=(), count=8) -> str:
    """A tree of `count` joints; `mimics` holds (follower, leader) numbers of joints.

    With mimics it is a chain: Pinocchio wants a leader before its followers, depth first.
    """
    parts = ['<robot name="random"><link name="root"/>']
    follows = dict(mimics)
    for i in range(count):
        parent = "root" if i == 0 else f"link{i - 1 if mimics else rng.integers(max(0, i - 3), i)}"
        tensor = random_tensor(rng)
        entries = " ".join(
            f'{key}="{tensor[r, c]:.15g}"'
            for key, r, c in zip(
                ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2), strict=True
            )
        )
        parts.append(
            f'<link name="link{i}"><inertial>'
            f'<origin xyz="{numbers(rng.normal(size=3))}" rpy="{numbers(rng.normal(size=3))}"/>'
            f'<mass value="{rng.uniform(0.5, 2.0):.15g}"/><inertia {entries}/></inertial></link>'
        )
        kind = kinds[i % len(kinds)]
        mimic = ""
        if i in follows:
            multiplier, offset = rng.normal(size=2)
            mimic = f'<mimic joint="joint{follows[i]}" multiplier="{multiplier:.15g}" offset="{offset:.15g}"/>'
        parts.append(
            f'<joint name="joint{i}" type="{kind}"><parent link="{parent}"/><child link="link{i}"/>'
            f'<origin xyz="{numbers(rng.normal(size=3))}" rpy="{numbers(rng.normal(size=3))}"/>'
            f'<axis xyz="{numbers(rng.normal(size=3))}"/>{mimic}'
            '<limit lower="-2" upper="2" velocity="3" effort="4"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def random_mjcf(rng, *, count=7) -> str:
    """A tree of bodies with 0 to 3 hinges and slides each, anchors and references away from zero."""
    bodies = []
    parents = [-1 if i == 0 else int(rng.integers(max(-1, i - 3), i)) for i in range(count)]
    for i in range(count):
        tensor = random_tensor(rng)
        joints = "".join(
            f'<joint name="joint{i}{k}" type="{rng.choice(["hinge", "slide"])}" '
            f'axis="{numbers(rng.normal(size=3))}" pos="{numbers(rng.normal(size=3))}" '
            f'ref="{rng.normal():.15g}"/>'
            for k in range(rng.integers(0 if i else 1, 4))
        )
        bodies.append(
            f'<body name="body{i}" pos="{numbers(rng.normal(size=3))}" quat="{numbers(rng.normal(size=4))}">'
            f'{joints}<inertial pos="{numbers(rng.normal(size=3))}" mass="{rng.uniform(0.5, 2.0):.15g}" '
            f'fullinertia="{numbers(tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])}"/>'
            f'<site name="site{i}" pos="{numbers(rng.normal(size=3))}" quat="{numbers(rng.normal(size=4))}"/>'
        )

    def nested(parent):
        return "".join(bodies[i] + nested(i) + "</body>" for i in range(count) if parents[i] == parent)

    return f'<mujoco><compiler angle="radian"/><worldbody>{nested(-1)}</worldbody></mujoco>'
