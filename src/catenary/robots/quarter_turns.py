"""Quarter turns that a file writes with few digits, such as 1.570796: recognised for formulas.

Formulas of a robot are short where its joints' axes are at right angles, and a turn that is 3e-7 rad off would fill
them with terms of 3e-7. Numbers are computed from what the file says.
"""

from dataclasses import replace

import numpy as np

from catenary.arrays import Floats
from catenary.robots.model import RobotModel, Tree

_WITHIN_RAD = 1e-6  # [rad] that a quarter turn may be off
_ROUNDING_RAD = 1e-12  # [rad] that is no digit of a file


def with_quarter_turns(model: RobotModel) -> RobotModel:
    """Return a robot whose turns, where they are multiples of quarter turns to within 1e-6 rad, are so exactly.

    These are constant rotations from one joint's frame to the next that take an axis to an axis, joints' axes along
    one of their frame, and constants of turning joints. A robot that has none but exact ones is returned itself.
    """
    off = _turns_off(model.tree, model.offset)
    if not ((off > _ROUNDING_RAD) & (off <= _WITHIN_RAD)).any():
        return model
    tree = model.tree
    rounded = np.round(tree.rotation) + 0.0
    turns = (_off_axis(tree.rotation.swapaxes(1, 2)).min(axis=1) <= _WITHIN_RAD)[:, None, None]
    rotation = np.where(turns & (np.abs(tree.rotation - rounded) <= _WITHIN_RAD), rounded, tree.rotation)
    axis = np.where(_off_axis(tree.axis)[:, None] > _WITHIN_RAD, tree.axis, np.round(tree.axis) + 0.0)
    quarters = _quarters(model.offset)
    is_quarter = ~tree.prismatic & (np.abs(model.offset - quarters) <= _WITHIN_RAD)
    offset = np.where(is_quarter, quarters, model.offset)
    return replace(model, tree=tree._replace(rotation=rotation, axis=axis), offset=offset)


def quarter_turn_notes(names: tuple[str, ...], tree: Tree, offset: Floats) -> list[str]:
    """Return in words which links' turns are taken for quarter turns in formulas."""
    off = _turns_off(tree, offset)
    those = (off > _ROUNDING_RAD) & (off <= _WITHIN_RAD)
    links = [name for name, mine in zip(names, those, strict=True) if mine.any()]
    note = f"quarter turns, to within {off[those].max(initial=0.0):.1e} rad, are exact in formulas"
    return [f"{note} ({', '.join(links)})"] if links else []


def _turns_off(tree: Tree, offset: Floats) -> Floats:
    """Return the deviations from multiples of quarter turns [rad], (n_tree, 5): rotations, axes, constants."""
    constant = np.where(tree.prismatic, 0.0, np.abs(offset - _quarters(offset)))
    return np.column_stack([_off_axis(tree.rotation.swapaxes(1, 2)), _off_axis(tree.axis), constant])


def _quarters(angle: Floats) -> Floats:
    """Return the nearest multiples of quarter turns [rad]."""
    return np.asarray(0.5 * np.pi * np.round(angle / (0.5 * np.pi)))


def _off_axis(vectors: Floats) -> Floats:
    """Return the angles (...) between unit vectors (..., 3) and the coordinate axis nearest to each, small ones."""
    return np.asarray(np.linalg.norm(np.sort(np.abs(vectors), axis=-1)[..., :2], axis=-1))
