"""A robot on six more coordinates that hold its base: their torques are the force and moment under it."""

from dataclasses import replace

import numpy as np

from catenary.robots.actuation import Friction, default_actuation
from catenary.robots.cut import driven_actuation
from catenary.robots.model import Frame, RobotModel, Tree

BASE_JOINTS = (*(f"base_force:{axis}" for axis in "xyz"), *(f"base_moment:{axis}" for axis in "xyz"))
_BASE_BODY = "base_body"  # what the base itself weighs, above the sensor


def on_base_joints(model: RobotModel) -> RobotModel:
    """Return a robot whose first six coordinates, held at zero, carry its base.

    Their torques are the force [N] and the moment about the base's origin [Nm], in base axes, that hold the base: what
    a sensor under it measures. As a regressor these rows are those of a free-flyer [Pinocchio]. The base has a body of
    its own, without numbers; a constant on each of the six is the sensor's bias.
    """
    n, m, tree = model.n, 6, model.tree
    sliding, still = np.arange(m) < 3, np.zeros((m, 3))
    before = Tree(
        parent=np.arange(m) - 1, prismatic=sliding, rotation=np.tile(np.eye(3), (m, 1, 1)), origin=still,
        axis=np.tile(np.eye(3), (2, 1)), mass=np.zeros(m), com=still, inertia=np.zeros((m, 3, 3)),
    )  # fmt: skip
    after = tree._replace(parent=tree.parent + m)  # -1, the base, is the last of the six
    links = (*(f"{name} held" for name in BASE_JOINTS[:-1]), _BASE_BODY)
    actuation = default_actuation(model.joint_names) if model.actuation is None else model.actuation
    own = driven_actuation(model.name, actuation, np.eye(n, m + n, m), np.zeros(n))
    biases = tuple(
        Friction(name, row, coulomb=False, viscous=False)
        for name, row in zip(BASE_JOINTS, np.eye(m, m + n), strict=True)
    )
    limits = {key: np.r_[np.full(m, value), getattr(model, key)] for key, value in _LIMITS.items()}
    return replace(
        model,
        joint_names=(*BASE_JOINTS, *model.joint_names),
        joint_units=(*("m",) * 3, *("rad",) * 3, *model.joint_units),
        link_names=(*links, *model.link_names),
        tree=Tree(*(np.concatenate(pair) for pair in zip(before, after, strict=True))),
        coupling=np.block([[np.eye(m), np.zeros((m, n))], [np.zeros((len(tree.parent), m)), model.coupling]]),
        offset=np.r_[np.zeros(m), model.offset],
        **limits,
        frames={name: Frame(link + m if link >= 0 else link, pose) for name, (link, pose) in model.frames.items()},
        missing_inertia=(_BASE_BODY, *model.missing_inertia),
        massless=(*links[:-1], *model.massless),
        axes_of_com=np.vstack([np.ones((m, 3), dtype=bool), model.axes_of_com]),
        actuation=replace(own, friction=(*biases, *own.friction), values=None, effort_scale=None),
        closed_form=None,
        unseen=(),
        without_payload=None,
        file_order=(),
    )


_LIMITS = {"lower": 0.0, "upper": 0.0, "velocity_limit": np.inf, "effort_limit": np.inf}
