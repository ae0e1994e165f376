"""Where a frame of a robot can be."""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import frame_poses
from catenary.errors import InputError
from catenary.robots.model import RobotModel

AT_A_LIMIT = 0.3  # of the positions of each joint: else the edge of a workspace is hardly ever drawn


def reachable_points(
    model: RobotModel, frame: str | None = None, *, count: int = 4_000, rng: np.random.Generator
) -> Floats:
    """Return points that a frame's origin reaches, at random joint positions, (count, 3) in the base frame [m].

    Each joint by itself is anywhere in its range, and at either end of it more often; one that turns without limits is
    anywhere in a turn. Links may pass through each other and through the floor.

    Args:
        model: The robot.
        frame: Name of the frame; the model's tip when None.
        count: How many points.
        rng: Draws them.

    Raises:
        InputError: A joint that slides without limits; no frame of that name.
    """
    lower, upper = np.array(model.lower), np.array(model.upper)
    open_ended = ~(np.isfinite(lower) & np.isfinite(upper))
    turns = np.array(model.joint_units) == "rad"
    if (open_ended & ~turns).any():
        name = model.joint_names[int(np.flatnonzero(open_ended & ~turns)[0])]
        raise InputError(
            f'robot "{model.name}": joint "{name}" slides without limits: no end to its workspace'
        )
    full_turn = open_ended | (turns & (upper - lower > 2.0 * np.pi))
    lower[full_turn], upper[full_turn] = -np.pi, np.pi
    at = rng.random((count, model.n))
    ends = rng.random((count, model.n)) < AT_A_LIMIT
    at = np.where(ends & ~full_turn, np.round(at), at)
    return frame_poses(model, lower + at * (upper - lower), frame)[1]
