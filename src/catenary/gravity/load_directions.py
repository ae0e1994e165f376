"""How gravity parameters change when a robot takes something up: the directions that a payload can move them in."""

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.gravity.compact import CompactRegressor
from catenary.gravity.regressor import carried
from catenary.gravity.regressor_recursion import CARRIED_MASS

PER_LOAD = 4  # mass, and moments about three axes


def load_directions(regressor: CompactRegressor, frame: str) -> Floats:
    """Change (p, 4) of the compact parameters per load on a frame.

    First column: 1 kg at the frame's origin. The others: 1 kg m of first moment about it, along each of its axes. The
    parameters are linear in masses and moments, so a body of mass m with its centre at c in the frame changes them by
    the columns times (m, m c). What the structure cannot hold is left out: a moment
    off the axes that `axes_of_com` declares.

    Raises:
        InputError: No such frame, or one of the base, whose load no joint carries.
    """
    model = regressor.model
    link, pose = model.frame(frame)
    if link < 0:
        raise InputError(
            f'robot "{model.name}": frame "{frame}" is fixed to the base: no joint would carry a load'
        )
    mass = np.zeros(len(model.tree.parent))
    mass[link] = 1.0
    moments, masses = carried(model.tree._replace(mass=mass, com=np.zeros_like(model.tree.com)))
    directions = np.zeros((len(regressor.labels), PER_LOAD))
    for at, along, target in zip(*regressor.columns, strict=True):
        if along == CARRIED_MASS:
            directions[target, 0] = masses[at]
        else:
            directions[target, 0] = moments[at, along]
            if at == link:
                directions[target, 1 + along] = 1.0
    directions[:, 0] += directions[:, 1:] @ pose.position
    directions[:, 1:] = directions[:, 1:] @ pose.rotation
    return directions
