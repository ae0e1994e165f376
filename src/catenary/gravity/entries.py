"""Entries of the compact regressor written out: sums of products of sines and cosines, such as c1 and c12.

Between a joint k and a link j it carries lie turns about axes, with constant rotations between them. Joints with
parallel axes in a row make one turn, by the sum of their angles, and a turn leaves its own axis alone. So an entry
-gravity . (z_k x e), e an axis of frame j, is the product of gravity turned as far as the turn that joint k belongs
to, and of e turned back as far as there: each sine and cosine comes at most once in a term, and like terms cancel.
"""

from typing import NamedTuple, TypeVar

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.terms import (
    SymbolicVector,
    Terms,
    TooLongError,
    Turn,
    angle_atom,
    cleaned,
    constant_vector,
    crossed,
    dotted,
    multiplied,
    scaled,
    sum_of,
    times,
    turned,
)
from catenary.robots.model import RobotModel

Written = TypeVar("Written", Terms, SymbolicVector)


class _Way(NamedTuple):
    """The way from the base to one link."""

    turns: list[Turn]
    end: Floats  # (3, 3) constant rotation after the last turn
    joints: dict[int, tuple[int, Floats]]  # joint -> its turn (-1 before the first), and its axis there


def moment_entries(model: RobotModel, link: int, axis: Floats, gravity: Floats) -> list[Terms | None]:
    """Write what a first moment along an axis (3,) of a link asks of each coordinate; None for what is too long.

    gravity (3,) is a constant, such as (0, 0, -1) for a level base, in units of the free fall.
    """
    way = _way(model, link)
    down, seen = _gravity_before(way, gravity), _seen_before(way, axis)
    entries: list[Terms | None] = []
    for row in range(model.n):
        total: Terms = {}
        try:
            for joint, (turn, z) in way.joints.items():
                weight = float(model.coupling[joint, row])
                if weight != 0.0 and not model.tree.prismatic[joint]:  # -weight gravity . (z x e)
                    held = dotted(_short(down[turn]), crossed(z, _short(seen[turn])))
                    total = sum_of(total, scaled(held, -weight))
            entries.append(total)
        except TooLongError:
            entries.append(None)
    return entries


def full_entry(
    model: RobotModel, joint: int, frame: int, axis: Floats, gravity: Floats, coordinate: int
) -> Terms | None:
    """Write an entry of the paper's full regressor, -gravity . (z_joint x e); None for what is too long.

    Unlike `moment_entries` it stands for one joint alone, whether it carries the frame or not.

    Args:
        model: The robot.
        joint: Index of a joint of the tree.
        frame: Index of a link, -1 for the base.
        axis: (3,) e in that frame.
        gravity: (3,) a constant, such as (0, 0, -1) for a level base, in units of the free fall.
        coordinate: Row of the regressor.
    """
    weight = float(model.coupling[joint, coordinate])
    if weight == 0.0 or model.tree.prismatic[joint]:
        return {}
    try:
        z = _in_base(model, joint, model.tree.axis[joint])
        e = constant_vector(axis) if frame < 0 else _in_base(model, frame, axis)
        # -gravity . (z x e) = (gravity x e) . z
        return scaled(dotted(crossed(gravity, e), z), weight)
    except TooLongError:
        return None


def _in_base(model: RobotModel, link: int, axis: Floats) -> SymbolicVector:
    """Return an axis of a link in the base frame."""
    way = _way(model, link)
    v = constant_vector(way.end @ axis)
    for turn in reversed(way.turns):
        v = times(turn.before, turned(turn, v, back=False))
    return v


def mass_entries(model: RobotModel, link: int, gravity: Floats) -> list[Terms | None]:
    """Write what the mass that a prismatic joint carries asks of each coordinate; None for what is too long."""
    axis = model.tree.axis[link]
    x, sign = angle_atom("q", model.coupling[link])
    offset = float(model.offset[link])
    way = _way(model, link)
    entries: list[Terms | None] = []
    for row, moment in enumerate(moment_entries(model, link, axis, gravity)):
        factor = float(model.coupling[link, row])
        try:
            total = sum_of(scaled(multiplied(_short(moment), x), sign), scaled(_short(moment), offset))
            if factor != 0.0 and way.turns:
                own = dotted(_short(_gravity_before(way, gravity)[0]), _short(_seen_before(way, axis)[0]))
                total = sum_of(total, scaled(own, -factor))
            elif factor != 0.0:
                total = sum_of(total, cleaned({(): -factor * float(gravity @ (way.end @ axis))}))
            entries.append(total)
        except TooLongError:
            entries.append(None)
    return entries


def _short(written: Written | None) -> Written:
    """Return what could be written out.

    Raises:
        TooLongError: It could not.
    """
    if written is None:
        raise TooLongError
    return written


def _way(model: RobotModel, link: int) -> _Way:
    tree = model.tree
    path = [link]
    while tree.parent[path[0]] >= 0:
        path.insert(0, int(tree.parent[path[0]]))
    turns: list[Turn] = []
    joints: dict[int, tuple[int, Floats]] = {}
    constant = np.eye(3)
    for i in path:
        constant = constant @ tree.rotation[i]
        z = constant @ tree.axis[i]
        if tree.prismatic[i]:
            joints[i] = (len(turns) - 1, z)
            continue
        angle = (np.array(model.coupling[i]), float(model.offset[i]))
        if turns and np.linalg.norm(np.cross(turns[-1].axis, z)) < 1e-9:
            before, axis, (factors, offset) = turns[-1]
            sign = 1.0 if axis @ z > 0.0 else -1.0
            turns[-1] = Turn(before, axis, (factors + sign * angle[0], offset + sign * angle[1]))
            joints[i] = (len(turns) - 1, sign * axis)
        else:
            turns.append(Turn(constant, tree.axis[i], angle))
            constant = np.eye(3)
            joints[i] = (len(turns) - 1, tree.axis[i])
    return _Way(turns, constant, joints)


def _gravity_before(way: _Way, gravity: Floats) -> list[SymbolicVector | None]:
    """Return gravity in the frame that each turn starts from; None from where it is too long."""
    out: list[SymbolicVector | None] = [None] * len(way.turns)
    v = constant_vector(gravity)
    try:
        for k, turn in enumerate(way.turns):
            here = times(turn.before.T, v)
            out[k] = here
            v = turned(turn, here, back=True)
    except TooLongError:
        pass
    return out


def _seen_before(way: _Way, axis: Floats) -> list[SymbolicVector | None]:
    """Return an axis of the way's end in the frame that each turn starts from; None where it is too long."""
    out: list[SymbolicVector | None] = [None] * len(way.turns)
    v = constant_vector(way.end @ axis)
    try:
        for k in range(len(way.turns) - 1, -1, -1):
            here = turned(way.turns[k], v, back=False)
            out[k] = here
            v = times(way.turns[k].before, here)
    except TooLongError:
        pass
    return out
