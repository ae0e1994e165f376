"""What a robot can hit beside itself: a floor, boxes, meshes, all standing still in the base frame."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.errors import FileFormatError, InputError
from catenary.robots.geometry import Box, HalfSpace, MeshFile, Shape, check_form
from catenary.spatial import Pose


def floor_at(height: float) -> Shape:
    """Return a floor: all that lies below a height [m] in the base frame."""
    if not np.isfinite(height):
        raise InputError(f"floor: height {height}, expected a finite number of metres")
    return Shape("floor", -1, Pose(np.eye(3), np.array([0.0, 0.0, height])), HalfSpace())


def box_at(number: int, numbers: Sequence[float]) -> Shape:
    """Return a box: its centre x, y, z in the base frame and its edges along x, y, z [m]."""
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(
            f"box {number}: expected six numbers, its centre x,y,z and its edges x,y,z in m, got {list(numbers)}"
        )
    form = Box(*(float(v) for v in numbers[3:]))
    check_form(f"box {number}", form)
    return Shape(f"box {number}", -1, Pose(np.eye(3), np.array(numbers[:3], dtype=float)), form)


def mesh_at(path: Path, place: Sequence[float]) -> Shape:
    """Return the mesh of a file whose origin stands at `place` (3,) [m] in the base frame, along its axes."""
    if not path.is_file():
        raise FileFormatError(f"{path}: no such mesh")
    if len(place) != 3 or not np.isfinite(place).all():
        raise InputError(f"{path}: expected its place x,y,z in m, got {list(place)}")
    return Shape(path.name, -1, Pose(np.eye(3), np.array(place, dtype=float)), MeshFile(path))
