"""How fast the points of a body can move for the speed of each joint that carries it."""

import numpy as np

from catenary.arrays import Floats
from catenary.collision.bodies import Body
from catenary.robots.model import RobotModel


def reach_of_body(model: RobotModel, body: Body) -> Floats:
    """Return the largest speed (n_tree,) of a body's points for unit speed of each tree joint [m or 1].

    A turning joint moves a point by at most its distance from the axis: no more than the way along the links to it,
    whatever the joints between do; the first piece counts across the axis only. A sliding joint moves all it carries
    by its own speed. Unlimited sliding joints reach without bound.
    """
    tree = model.tree
    reach = np.zeros(len(tree.parent))
    travel = _travel(model)
    chain: list[int] = []
    link = body.link
    while link >= 0:
        chain.append(link)
        link = int(tree.parent[link])
    for place, joint in enumerate(chain):
        if tree.prismatic[joint]:
            reach[joint] = 1.0
            continue
        beyond = chain[:place][::-1]  # joints between this one and the body, the nearest first
        if not beyond:
            ends = (_across(tree.axis[joint], end) for end in (body.start, body.end))
            reach[joint] = max(ends) + body.radius
            continue
        way = _across(tree.axis[joint], tree.origin[beyond[0]]) + travel[beyond[0]]
        way += sum(float(np.linalg.norm(tree.origin[k])) + travel[k] for k in beyond[1:])
        reach[joint] = way + body.extent
    return reach


def _across(axis: Floats, vector: Floats) -> float:
    """Return the length of a vector across an axis."""
    return float(np.linalg.norm(vector - (vector @ axis) * axis))


def _travel(model: RobotModel) -> Floats:
    """Return how far each sliding tree joint is from its zero at most [m]; zero of turning ones."""
    with np.errstate(invalid="ignore"):
        middle = 0.5 * (model.lower + model.upper)
        half = 0.5 * (model.upper - model.lower)
        used = model.coupling != 0.0
        middle, half = (np.where(used, v[None, :], 0.0) for v in (middle, half))
        farthest = np.abs((model.coupling * middle).sum(axis=1) + model.offset)
        farthest = farthest + (np.abs(model.coupling) * half).sum(axis=1)
    farthest = np.where(np.isnan(farthest), np.inf, farthest)
    return np.where(model.tree.prismatic, farthest, 0.0)
