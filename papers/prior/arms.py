"""Simulated cable-driven arms, each drawn anew: joints, couplings, cables, friction, loads, motion and measurement.

Quasi-static: a cable's stretch follows its load and its friction, and friction follows the side that the last motion
left it on, which is the physics of the simulated RAVEN-II (docs/plant.md) without what depends on velocity. Ranges are
wide on purpose: what these arms have in common is to hold for arms that nobody has modelled. Positions are in half
ranges, errors in their own spread; both are standardised before anything is learnt.
"""

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats

JOINTS = (3, 8)  # from, and below
PLAYS = 3  # parallel friction elements of a cable


def drawn_arm(rng: np.random.Generator, rows: int) -> MotionLog:
    """Return a recording of another arm, with torques."""
    n = int(rng.integers(*JOINTS))
    q = motion(rng, rows, n)
    coupling = _coupling(rng, n)
    cables = q @ coupling.T  # what each motor winds up
    load, friction = _load(rng, q), _friction(rng, cables)
    stretch = _scales(rng, n, -0.5, 1.0) * load + _scales(rng, n, 0.0, 1.0) * friction * (1.0 + 0.2 * np.abs(load))
    error = stretch @ np.linalg.pinv(coupling).T * _scales(rng, n, 0.0, 0.7)
    believed = rng.normal(size=(n, n)) * _scales(rng, (n, n), -1.5, 1.0) * (rng.random((n, n)) < 0.5)
    error += q @ believed.T + q * rng.normal(size=n) * _scales(rng, n, -0.5, 1.0)  # wrong couplings and ratios
    error += _scales(rng, n, -1.0, 1.0) * np.sin(q * rng.uniform(1.0, 12.0, n) + _phases(rng, n))  # run-out
    error /= error.std(axis=0)
    error += _slow(rng, rows, n) * np.exp(rng.uniform(np.log(0.01), np.log(0.5), n))
    error += rng.normal(size=q.shape) * np.exp(rng.uniform(np.log(0.01), 0.0, n))
    return MotionLog(
        name="drawn",
        joint_names=tuple(f"J{j + 1}" for j in range(n)),
        joint_units=("rad",) * n,
        q_nominal=q,
        q_encoder=q + error,
        ok=np.ones(rows, dtype=bool),
        tau=load + friction + 0.05 * rng.normal(size=q.shape),
        simulated=True,
    )


def motion(rng: np.random.Generator, rows: int, n: int) -> Floats:
    """Return positions (rows, n) in half ranges: far way-points, small steps, or moves from way-point to way-point."""
    kind = int(rng.integers(3))
    if kind == 0:
        q = rng.uniform(-1.0, 1.0, (rows, n))
    elif kind == 1:
        step = np.exp(rng.uniform(np.log(0.03), np.log(0.3)))
        walk = np.cumsum(step * rng.normal(size=(rows, n)), axis=0) + rng.uniform(-1.0, 1.0, n)
        q = np.abs((walk + 1.0) % 4.0 - 2.0) - 1.0  # reflected at both ends
    else:
        rows_per_move = int(rng.integers(3, 15))
        points = rng.uniform(-1.0, 1.0, (rows // rows_per_move + 2, n))
        at = np.arange(rows) / rows_per_move
        q = np.column_stack([np.interp(at, np.arange(len(points)), column) for column in points.T])
    return q * rng.uniform(0.3, 1.0, n) if rng.random() < 0.3 else q


def _coupling(rng: np.random.Generator, n: int) -> Floats:
    """Return how much of each joint each cable winds up: joints before it, and a wrist's last two one another."""
    coupling = np.tril(rng.normal(size=(n, n)) * _scales(rng, (n, n), -1.0, 0.8) * (rng.random((n, n)) < 0.6), -1)
    coupling += np.eye(n)
    if rng.random() < 0.5:
        coupling[-2, -1] = rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0])
        coupling[-1, -2] = -coupling[-2, -1] * rng.uniform(0.3, 1.0)
    return np.asarray(coupling)


def _load(rng: np.random.Generator, q: Floats) -> Floats:
    """Return a smooth load of each joint by the joints up to it, as gravity's is."""
    n = q.shape[1]
    load = np.zeros_like(q)
    for _ in range(2):
        slopes = np.tril(rng.normal(size=(n, n))) * rng.uniform(0.2, 1.2, (n, 1))
        load += rng.normal(size=n) * np.sin(q @ slopes.T + _phases(rng, n))
    return load


def _friction(rng: np.random.Generator, cables: Floats) -> Floats:
    """Return the friction in cables (N, n): parallel play elements [Prandtl-Ishlinskii]."""
    friction = np.zeros_like(cables)
    for _ in range(PLAYS):
        widths = np.exp(rng.uniform(np.log(0.01), np.log(0.5), cables.shape[1])) * np.ptp(cables, axis=0)
        state, weights = cables[0].copy(), _scales(rng, cables.shape[1], 0.0, 0.8)
        for row, position in enumerate(cables):
            state = np.minimum(np.maximum(state, position - widths), position + widths)
            friction[row] += weights * (state - position) / widths
    return friction


def _slow(rng: np.random.Generator, rows: int, n: int) -> Floats:
    """Return what drifts or is measured wrong for a while: autoregressive, of unit variance."""
    kept = np.exp(-1.0 / np.exp(rng.uniform(np.log(3.0), np.log(300.0), n)))
    noise, value, found = rng.normal(size=(rows, n)), np.zeros(n), np.empty((rows, n))
    for row in range(rows):
        value = kept * value + np.sqrt(1.0 - kept**2) * noise[row]
        found[row] = value
    return found


def _scales(rng: np.random.Generator, size: int | tuple[int, int], middle: float, spread: float) -> Floats:
    return np.exp(rng.normal(middle, spread, size))


def _phases(rng: np.random.Generator, n: int) -> Floats:
    return rng.uniform(0.0, 2.0 * np.pi, n)
