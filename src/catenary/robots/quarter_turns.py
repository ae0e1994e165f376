"""Quarter turns that a file writes with few digits, such as 1.570796: recognised for formulas.

Formulas of a robot are short where its joints' axes are at right angles, and a turn that is 3e-7 rad off would fill
them with terms of 3e-7. Numbers are computed from what the file says.
"""

from dataclasses import replace

import numpy as np

from catenary.arrays import Floats
from catenary.robots.model import RobotModel, Tree

WITHIN = 1e-6  # [rad] that a quarter turn may be off
ROUNDING = 1e-12  # [rad] that is no digit of a file


def with_quarter_turns(model: RobotModel) -> RobotModel:
    """Return a robot whose turns, where they are multiples of quarter turns to within 1e-6 rad, are so exactly.

    These are constant rotations from one joint's frame to the next that take an axis to an axis, joints' axes along
    one of their frame, and constants of turning joints. A robot that has none but exact ones is returned itself.
    """
    off = _turns_off(model.tree, model.offset)
    if not ((off > ROUNDING) & (off <= WITHIN)).any():
        return model
    tree = model.tree
    rotation = np.array([_exact_rotation(each) for each in tree.rotation])
    axis = np.array([_exact_axis(each) for each in tree.axis])
    quarters = 0.5 * np.pi * np.round(model.offset / (0.5 * np.pi))
    is_quarter = ~tree.prismatic & (np.abs(model.offset - quarters) <= WITHIN)
    return replace(
        model, tree=tree._replace(rotation=rotation, axis=axis), offset=np.where(is_quarter, quarters, model.offset)
    )


def quarter_turn_notes(names: tuple[str, ...], tree: Tree, offset: Floats) -> list[str]:
    """Return in words which links' turns are taken for quarter turns in formulas."""
    off = _turns_off(tree, offset)
    those = (off > ROUNDING) & (off <= WITHIN)
    links = [name for name, mine in zip(names, those, strict=True) if mine.any()]
    told = f"quarter turns, to within {off[those].max(initial=0.0):.1e} rad, are exact in formulas"
    return [f"{told} ({', '.join(links)})"] if links else []


def _turns_off(tree: Tree, offset: Floats) -> Floats:
    """Return how far each link's turns are from multiples of quarter turns [rad], (n_tree, 5).

    Of its rotation that of each axis to the nearest of the parent's, of its joint's axis likewise, of its constant.
    """
    rows = []
    for rotation, axis, constant, slides in zip(tree.rotation, tree.axis, offset, tree.prismatic, strict=True):
        quarters = 0.5 * np.pi * round(constant / (0.5 * np.pi))
        rows.append(
            [
                *(_off_axis(rotation[:, k]) for k in range(3)),
                _off_axis(axis),
                0.0 if slides else abs(constant - quarters),
            ]
        )
    return np.array(rows)


def _off_axis(vector: Floats) -> float:
    """Return the angle between a unit vector and the nearest coordinate axis, for small ones [rad]."""
    others = np.delete(vector, int(np.argmax(np.abs(vector))))
    return float(np.linalg.norm(others))


def _exact_axis(axis: Floats) -> Floats:
    return axis if _off_axis(axis) > WITHIN else np.round(axis) + 0.0


def _exact_rotation(rotation: Floats) -> Floats:
    """Return a rotation that takes to an axis exactly what it takes to within 1e-6 rad of one."""
    if min(_off_axis(rotation[:, k]) for k in range(3)) > WITHIN:
        return rotation
    near = np.round(rotation) + 0.0
    return np.where(np.abs(rotation - near) > WITHIN, rotation, near)
