"""Recordings of arms that move as designed, with torques of known dynamics, for tests of identification."""

from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import actuation_columns
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.plant import MotionLog
from catenary.robots.actuation import actuation_terms
from catenary.robots.model import RobotModel

LEVEL = np.array([0.0, 0.0, -9.81])
PLACE = (0.02, -0.1, 0.05)  # [m] of a payload, from the wrist


def sinusoids(rng: np.random.Generator, model: RobotModel, time: Floats) -> tuple[Floats, Floats, Floats]:
    """Positions, velocities, accelerations (N, n): three sines a joint, around the middle of its range."""
    bounded = np.isfinite(model.upper - model.lower)
    low, high = np.where(bounded, model.lower, -2.2), np.where(bounded, model.upper, 2.2)
    middle, reach = 0.5 * (low + high), 0.45 * (high - low)
    w = rng.uniform(1.0, 7.0, size=(3, 1, model.n))
    phase = rng.uniform(0.0, 6.28, size=(3, 1, model.n))
    angle = w * time[:, None] + phase
    q = middle + reach / 3.0 * np.sin(angle).sum(axis=0)
    return q, reach / 3.0 * (w * np.cos(angle)).sum(axis=0), -reach / 3.0 * (w**2 * np.sin(angle)).sum(axis=0)


def torques(model: RobotModel, q: Floats, qd: Floats, qdd: Floats, beside: Floats) -> Floats:
    """Inverse dynamics, and friction, rotors and springs of these sizes."""
    actuation = model.assumed_actuation
    columns = actuation_columns(actuation_terms(actuation), q, qd, qdd, actuation.coulomb_velocity)
    return inverse_dynamics(model, q, qd, qdd, LEVEL) + columns @ beside


def recorded(
    model: RobotModel,
    seed: int,
    *,
    seconds: float = 30.0,
    rate: float = 200.0,
    noise: float = 0.0,
    beside: np.ndarray | None = None,
    **changes: Any,
) -> MotionLog:
    """A recording of an arm with known inertia; friction is 0.3 of each kind unless `beside` says otherwise."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(seconds * rate)) / rate
    q, qd, qdd = sinusoids(rng, model, time)
    count = len(actuation_terms(model.assumed_actuation))
    tau = torques(model, q, qd, qdd, np.full(count, 0.3) if beside is None else beside)
    fields: dict[str, Any] = {
        "name": f"run{seed}",
        "joint_names": model.joint_names,
        "joint_units": model.joint_units,
        "q_nominal": q,
        "ok": np.ones(len(q), dtype=bool),
        "time": time,
        "qd": qd,
        "tau": tau + noise * rng.normal(size=tau.shape),
    }
    return MotionLog(**(fields | changes))


SLOW = 0.25  # of the speed of `sinusoids`


def slow(
    model: RobotModel, seed: int, *, seconds: float = 25.0, gain: Any = (), zero: Any = (), gravity: Floats = LEVEL
) -> MotionLog:
    """A recording of an arm that moves slowly enough for gravity to matter, some axes times or beside a constant."""
    time = np.arange(int(100.0 * seconds)) / 100.0
    rng = np.random.default_rng(seed)
    q, qd, qdd = (SLOW**k * values for k, values in enumerate(sinusoids(rng, model, SLOW * time)))
    tau = torques(model, q, qd, qdd, np.full(3 * model.n, 0.3)) + 0.3 * rng.normal(size=q.shape)
    still = np.zeros_like(q)
    tau += inverse_dynamics(model, q, still, still, gravity) - inverse_dynamics(model, q, still, still, LEVEL)
    for axis, factor in gain:
        tau[:, axis] *= factor
    for axis, constant in zero:
        tau[:, axis] += constant
    return recorded(model, seed, seconds=0.1, q_nominal=q, qd=qd, tau=tau, ok=np.ones(len(q), bool), time=time)


def write_npz(log: MotionLog, path: Any, **changes: Any) -> None:
    """Write a recording as catenary identify reads it."""
    arrays = {"q": log.q_nominal, "dq": log.qd, "tau": log.tau, "t": log.time} | changes
    np.savez(path, **{key: values for key, values in arrays.items() if values is not None})
