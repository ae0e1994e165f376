"""The shapes of a robot table's links: capsules between points, `[[capsule]]`."""

from pathlib import Path

import numpy as np

from catenary.config import load_toml
from catenary.errors import InputError
from catenary.robots.geometry import Geometry, capsule_between, shape_on
from catenary.robots.model import RobotModel
from catenary.robots.table import RobotTable


def table_shapes(path: Path, model: RobotModel) -> Geometry | None:
    """Return the capsules of a robot table; None where it has none.

    Raises:
        InputError: A frame that is not there, or a size no robot has; the message names the file.
    """
    table = load_toml(path, RobotTable)
    if not table.capsule:
        return None
    shapes = []
    for row in table.capsule:
        start, end = np.array(row.from_m, dtype=float), np.array(row.to_m, dtype=float)
        pose, capsule = capsule_between(start, end, row.radius_m)
        try:
            link = model.frame(row.frame).link
            name = model.base if link < 0 else model.link_names[link]
            shapes.append(shape_on(table.name, model, row.frame, name, pose, capsule))
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
    origin = f"capsules of the table of {table.name}, {table.capsules_from}"
    return Geometry(model.name, tuple(shapes), origin, assumed=True)
