"""Motions and poses that show a robot's parameters: small condition number of the regressor, within the limits."""

from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.identification.base_parameters import BaseParameters, base_parameters
from catenary.identification.columns import Parameters
from catenary.identification.fourier_series import FourierSeries
from catenary.identification.motion_limits import CheckedMotion, MotionLimits, Room
from catenary.identification.options import Terms

CANDIDATES = 20  # poses to choose each static one from
ATTEMPTS = 100  # at finding one that is free


@dataclass(frozen=True)
class Excitation:
    """Rows of a motion, or poses to hold, and how well they show the base parameters."""

    time: Floats  # (N,) [s]; row numbers of static poses
    q: Floats  # (N, n)
    qd: Floats
    qdd: Floats
    condition: float  # of the regressor, columns scaled to length one
    base: BaseParameters
    terms: Terms
    series: FourierSeries | None = None  # of a motion: what it is between its rows
    checked: CheckedMotion | None = None

    @property
    def n_base(self) -> int:
        """How many base parameters there are."""
        return self.base.count


def static_poses(limits: MotionLimits, count: int, rng: np.random.Generator) -> Excitation:
    """Choose poses to hold, each the best of twenty random ones beside those before it (greedy log-determinant).

    Nothing touches in them, and the robot can hold its weight; the ways from one to the next are not looked at.

    Raises:
        InputError: Fewer poses than show all base parameters, or none that is free.
    """
    model, room, g = limits.model, limits.room, limits.gravity
    base = shown_parameters(Parameters(model, "static"), room, g, rng)
    least = -(-base.count // model.n)
    if count < least:
        raise InputError(f"{count} poses cannot show {base.count} base parameters: expected {least} or more")
    low, high = room.inner()
    scale, poses = None, []
    information = np.zeros((base.count, base.count))
    for _ in range(count):
        q = _candidates(limits, low, high, rng)
        Y = base.regressor(q, np.zeros_like(q), np.zeros_like(q), g)
        if scale is None:
            scale = np.sqrt(np.mean(Y**2, axis=(0, 1)))
            scale[scale == 0.0] = 1.0
            information = 1e-6 * np.eye(base.count)
        Y = Y / scale
        gains = np.linalg.slogdet(information + np.einsum("cab,cad->cbd", Y, Y))[1]
        best = int(np.argmax(gains))
        poses.append(q[best])
        information = information + Y[best].T @ Y[best]
    q = np.array(poses)
    zero = np.zeros_like(q)
    return Excitation(
        np.arange(count, dtype=float),
        q,
        zero,
        zero,
        condition_of(base, q, zero, zero, g),
        base,
        "static",
    )


def _candidates(limits: MotionLimits, low: Floats, high: Floats, rng: np.random.Generator) -> Floats:
    """Draw poses that are free; where few are, as many as were found."""
    if not limits.is_narrow:
        return rng.uniform(low, high, (CANDIDATES, limits.model.n))
    for _ in range(ATTEMPTS):
        free = limits.free_poses(rng.uniform(low, high, (CANDIDATES, limits.model.n)))
        if len(free):
            return free
    raise InputError(
        f'robot "{limits.model.name}": none of {ATTEMPTS * CANDIDATES} poses within the limits is free'
    )


def shown_parameters(
    parameters: Parameters, room: Room, gravity: Floats, rng: np.random.Generator
) -> BaseParameters:
    """Return the base parameters that motion within the limits shows."""
    low, high = room.inner()
    size = (200, parameters.model.n)
    moving = np.zeros(size), np.zeros(size)
    if parameters.terms == "full":
        moving = rng.normal(size=size), 5.0 * rng.normal(size=size)
    return base_parameters(parameters, gravity, (rng.uniform(low, high, size), *moving), rng)


def condition_of(base: BaseParameters, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> float:
    """Return the condition number of the regressor, columns scaled to length one."""
    Y = base.regressor(q, qd, qdd, gravity).reshape(-1, base.count)
    size = np.linalg.norm(Y, axis=0)
    return float(np.linalg.cond(Y / np.where(size > 0.0, size, 1.0)))
