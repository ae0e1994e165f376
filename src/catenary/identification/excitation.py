"""Motions and poses that show a robot's parameters: small condition number of the regressor, within the limits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.identification.base_parameters import BaseParameters, base_parameters
from catenary.identification.columns import Parameters
from catenary.identification.options import Terms
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

MARGIN = 0.05  # of a coordinate's range kept clear of its limits
CANDIDATES = 20  # poses to choose each static one from
ROWS = 120  # of a motion whose condition is looked at


@dataclass(frozen=True)
class Excitation:
    """Rows of a motion, or poses to hold, and how well they show the base parameters."""

    time: Floats  # (N,) [s]; row numbers of static poses
    q: Floats  # (N, n)
    qd: Floats
    qdd: Floats
    condition: float  # of the regressor, columns scaled to length one
    n_base: int
    terms: Terms


@dataclass(frozen=True)
class Room:
    """Where coordinates may go: limits of position and of velocity, all finite."""

    lower: Floats  # (n,)
    upper: Floats
    velocity: Floats


def room_of(
    model: RobotModel,
    *,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
) -> Room:
    """Return the limits to stay within: the robot's own, or narrower ones (n,) [rad, m, rad/s, m/s].

    Raises:
        InputError: A limit that neither the robot nor the caller gives, or one beyond the robot's.
    """
    limits: tuple[tuple[str, ArrayLike], ...] = (
        ("lower", model.lower if lower is None else lower),
        ("upper", model.upper if upper is None else upper),
        ("velocity", model.velocity_limit if velocity is None else velocity),
    )
    room = {key: as_array(key, values, (model.n,), finite=False) for key, values in limits}
    low, high, fastest = room.values()
    beyond = (low < model.lower) | (high > model.upper) | (fastest > model.velocity_limit)
    for i, name in enumerate(model.joint_names):
        where = f'robot "{model.name}"'
        for key, values in room.items():
            if not np.isfinite(values[i]):
                raise InputError(f"{where}: no {key} limit of {name}: give --{key} for all {model.n} joints")
        if not low[i] < high[i] or not fastest[i] > 0.0:
            raise InputError(f"{where}: {name}: expected lower < upper and a velocity above zero")
        if beyond[i]:
            raise InputError(f"{where}: {name}: the limits given go beyond the robot's own")
    return Room(low, high, fastest)


def static_poses(
    model: RobotModel, count: int, room: Room, rng: np.random.Generator, *, gravity: ArrayLike = LEVEL
) -> Excitation:
    """Choose poses to hold, each the best of twenty random ones beside those before it (greedy log-determinant).

    Raises:
        InputError: Fewer poses than show all base parameters.
    """
    g = as_array("gravity", gravity, (3,))
    base = _base(Parameters(model, "static"), room, g, rng)
    least = -(-base.count // model.n)
    if count < least:
        raise InputError(f"{count} poses cannot show {base.count} base parameters: expected {least} or more")
    low, high = _inner(room)
    scale, poses = None, []
    information = np.zeros((base.count, base.count))
    for _ in range(count):
        q = rng.uniform(low, high, (CANDIDATES, model.n))
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
        np.arange(count, dtype=float), q, zero, zero, _condition(base, q, zero, zero, g), base.count, "static"
    )


def fourier_motion(
    model: RobotModel,
    room: Room,
    rng: np.random.Generator,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    rate: float = 200.0,
    trials: int = 300,
    gravity: ArrayLike = LEVEL,
) -> Excitation:
    """Design one period of a motion that begins and ends at rest, and shows full dynamics well.

    q_i = centre + sum_k a_k / (k w) sin k w t - b_k / (k w) cos k w t with w = 2 pi / period (Swevers et al., "Optimal
    robot excitation and identification", IEEE Trans. Robotics and Automation 13(5), 1997), coefficients by random
    search from the best of `trials`, half of them anywhere, half around the best so far. Each joint is scaled to the
    larger part of its range that its velocity limit allows; the drawn share of it is part of the search.

    Args:
        model: The robot; needs no inertia.
        room: Limits to stay within.
        rng: Source of the coefficients.
        period: [s].
        harmonics: Two or more: with one alone nothing begins at rest.
        rate: Rows per second.
        trials: How many motions are looked at.
        gravity: (3,) in base axes [m/s2].

    Raises:
        InputError: A period, rate or number that is not positive, or fewer than three harmonics.
    """
    if not (period > 0.0 and rate > 0.0 and trials >= 1 and harmonics >= 3 and period * rate >= 2 * ROWS):
        raise InputError(
            f"fourier: expected a period and a rate of {2 * ROWS} rows at least, three or more harmonics and one "
            f"or more trials; got {period:g} s, {rate:g} Hz, {harmonics} harmonics, {trials} trials"
        )
    g = as_array("gravity", gravity, (3,))
    base = _base(Parameters(model, "full"), room, g, rng)
    coarse = np.arange(ROWS) * period / ROWS
    best: tuple[float, Floats, Floats] | None = None
    for trial in range(trials):
        if best is None or trial < trials // 2:
            coefficients = rng.normal(size=(2, harmonics, model.n))
            share = rng.uniform(0.6, 1.0, model.n)
        else:
            step = 0.5 * (1.0 - trial / trials) + 0.05
            coefficients = best[1] + step * rng.normal(size=best[1].shape)
            share = np.clip(best[2] + 0.2 * step * rng.normal(size=model.n), 0.3, 1.0)
        condition = _condition(base, *_motion(coefficients, share, period, coarse, room), g)
        if best is None or condition < best[0]:
            best = condition, coefficients, share
    assert best is not None
    time = np.arange(round(period * rate) + 1) / rate
    q, qd, qdd = _motion(best[1], best[2], period, time, room)
    return Excitation(time, q, qd, qdd, _condition(base, q, qd, qdd, g), base.count, "full")


def _motion(
    coefficients: Floats, share: Floats, period: float, time: Floats, room: Room
) -> tuple[Floats, Floats, Floats]:
    """Return positions, velocities, accelerations (N, n) of a scaled Fourier motion."""
    k = np.arange(1, coefficients.shape[1] + 1)
    w = 2.0 * np.pi / period * k
    # velocity sum a cos + b sin, acceleration sum -a w sin + b w cos: both zero at the start
    a = coefficients[0] - coefficients[0].mean(axis=0)
    b = coefficients[1] - w[:, None] * (w @ coefficients[1]) / (w @ w)
    # scaled on a fine grid, so that no row of another rate lies beyond
    fine = np.linspace(0.0, period, 40 * len(k), endpoint=False)
    q, qd, _ = _series(a, b, w, fine)
    low, high = _inner(room)
    reach = np.ptp(q, axis=0) * 1.01  # between two points of the grid it reaches less than a per cent further
    amplitude = share * np.minimum((high - low) / reach, 0.98 * room.velocity / np.abs(qd).max(axis=0))
    middle = 0.5 * (q.max(axis=0) + q.min(axis=0))
    q, qd, qdd = _series(a, b, w, time)
    return amplitude * (q - middle) + 0.5 * (low + high), amplitude * qd, amplitude * qdd


def _series(a: Floats, b: Floats, w: Floats, time: Floats) -> tuple[Floats, Floats, Floats]:
    sine, cosine = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
    return (
        sine @ (a / w[:, None]) - cosine @ (b / w[:, None]),
        cosine @ a + sine @ b,
        -sine @ (a * w[:, None]) + cosine @ (b * w[:, None]),
    )


def _inner(room: Room) -> tuple[Floats, Floats]:
    slack = MARGIN * (room.upper - room.lower)
    return room.lower + slack, room.upper - slack


def _base(parameters: Parameters, room: Room, gravity: Floats, rng: np.random.Generator) -> BaseParameters:
    low, high = _inner(room)
    size = (200, parameters.model.n)
    moving = np.zeros(size), np.zeros(size)
    if parameters.terms == "full":
        moving = rng.normal(size=size), 5.0 * rng.normal(size=size)
    return base_parameters(parameters, gravity, (rng.uniform(low, high, size), *moving), rng)


def _condition(base: BaseParameters, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> float:
    """Return the condition number of the regressor, columns scaled to length one."""
    Y = base.regressor(q, qd, qdd, gravity).reshape(-1, base.count)
    size = np.linalg.norm(Y, axis=0)
    return float(np.linalg.cond(Y / np.where(size > 0.0, size, 1.0)))
