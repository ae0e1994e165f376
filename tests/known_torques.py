"""Recordings of arms whose torques are known, spoilt by a known cause: truth for tests of explanations.

The true arm has masses 12 % and 5 mm from its file's, Coulomb, viscous, Stribeck and load-dependent friction, rotors,
zeros of torque and noise, of the size of its own torques.
"""

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters, torque_regressor
from catenary.identification.explanations.loads import point_mass
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

LOW, HIGH = -2.2, 2.2  # [rad] of joints that turn farther
UR_MIDDLE = np.array([0.0, -1.2, 1.0, -0.8, 0.5, 0.0])


@dataclass(frozen=True)
class Truth:
    """An arm and what was done to a recording of it."""

    name: str
    cause: str | None  # that explains it, by its hypothesis' name; None where it is sound
    joints: tuple[int, ...] = ()
    robot: str = "ur5e"
    seed: int = 1
    seconds: float = 40.0
    motion: float = 1.0  # its size, of the range
    masses: float = 0.12  # relative error of the file's masses
    friction: float = 1.0
    load: tuple[float, tuple[float, float, float]] | None = None  # [kg], place in the tip's frame [m]
    taken_up: float = 0.0  # [kg] after 45 % of the time
    gravity: tuple[float, float, float] = tuple(LEVEL)
    gain: Any = 1.0
    coupled: float = 0.0  # [Nm] friction of the last two joints' common drive
    locked: int | None = None
    spoil: dict[str, Any] = field(default_factory=dict)


def _true_parameters(model: RobotModel, error: float, seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    phi = link_parameters(model.tree).reshape(-1, PER_LINK)
    for p in phi:
        mass = p[0]
        p *= 1.0 + rng.uniform(-error, error)
        p[1:4] += mass * rng.normal(0.0, error / 24.0, 3)
    return phi.ravel()


def _carrying_parameters(model: RobotModel, truth: Truth) -> Floats:
    phi = _true_parameters(model, truth.masses, 3)
    if truth.load is not None:
        link, pose = model.frame().link, model.frame().pose
        place = pose.rotation @ np.array(truth.load[1]) + pose.position
        phi[PER_LINK * link : PER_LINK * (link + 1)] += truth.load[0] * point_mass(place)
    return phi


def true_gravity(truth: Truth, q: Floats) -> Floats:
    """Return the torques (N, n) that hold the true arm still on a level base."""
    model = load_robot(truth.robot)
    return torque_regressor(model, q, 0.0 * q, 0.0 * q, LEVEL) @ _carrying_parameters(model, truth)


def _motion(model: RobotModel, truth: Truth, rate: float) -> tuple[Floats, Floats, Floats, Floats]:
    rng, n = np.random.default_rng(truth.seed), model.n
    t = np.arange(0.0, truth.seconds, 1.0 / rate)
    low, high = np.clip(model.lower, LOW, None), np.clip(model.upper, None, HIGH)
    q, qd, qdd = np.zeros((3, len(t), n))
    for j in range(n):
        w = 2.0 * np.pi * np.array([rng.uniform(0.05, 0.12), rng.uniform(0.15, 0.3), rng.uniform(0.3, 0.5)])
        size = truth.motion * 0.27 * (high[j] - low[j]) * np.array([0.6, 0.28, 0.12])
        angle = w * t[:, None] + rng.uniform(0.0, 6.28, 3)
        q[:, j] = 0.5 * (low[j] + high[j]) + np.sin(angle) @ size
        qd[:, j], qdd[:, j] = np.cos(angle) @ (w * size), -np.sin(angle) @ (w**2 * size)
    return t, q + (UR_MIDDLE if truth.robot.startswith("ur") else 0.0), qd, qdd


@cache
def _usual_torque(robot: str) -> Floats:
    model = load_robot(robot)
    _, q, qd, qdd = _motion(model, Truth("", None, robot=robot, seed=99, seconds=20.0), 20.0)
    own = np.abs(torque_regressor(model, q, qd, qdd, LEVEL) @ link_parameters(model.tree)).mean(axis=0)
    return np.asarray(own + 0.6)


def known_torques(truth: Truth, rate: float = 200.0) -> MotionLog:
    """Return the recording."""
    model = load_robot(truth.robot)
    n, phi = model.n, _carrying_parameters(model, truth)
    t, q, qd, qdd = _motion(model, truth, rate)
    if truth.locked is not None:
        q[:, truth.locked] = 0.3
        qd[:, truth.locked] = qdd[:, truth.locked] = 0.0
    usual, gravity = _usual_torque(truth.robot), np.array(truth.gravity)
    own = torque_regressor(model, q, qd, qdd, gravity) @ phi
    coulomb, rotor = 0.22 * usual, np.minimum(0.12 * usual, 2.5)
    sliding = coulomb + 0.03 * np.abs(own) + 0.3 * coulomb * np.exp(-((qd / 0.08) ** 2))
    if truth.taken_up:
        phi = _carrying_parameters(model, replace(truth, load=(truth.taken_up, (0.02, 0.0, 0.06))))
        later = len(own) * 9 // 20
        own[later:] = torque_regressor(model, q[later:], qd[later:], qdd[later:], gravity) @ phi
    tau = own + rotor * qdd + truth.friction * (sliding * np.tanh(qd / 0.004) + 1.1 * coulomb * qd)
    tau += 0.04 * usual * np.sin(2.0 * np.arange(n) + 1.0)
    tau[:, -2:] += truth.coupled * np.tanh((qd[:, -2] + qd[:, -1]) / 0.004)[:, None]
    rng = np.random.default_rng(truth.seed + 100)
    tau = (tau + 0.035 * usual * rng.normal(size=tau.shape)) * truth.gain
    q, qd, tau = _spoilt(q, qd, tau, **truth.spoil)
    q, qd = q + rng.normal(0.0, 2e-5, q.shape), qd + rng.normal(0.0, 2e-3, q.shape)
    every = np.ones(len(q), dtype=bool)
    return MotionLog(truth.name, model.joint_names, model.joint_units, q, every, time=t[: len(q)], qd=qd, tau=tau)


def _spoilt(
    q: Floats,
    qd: Floats,
    tau: Floats,
    *,
    signs: dict[int, str] | None = None,
    zeros: dict[int, float] | None = None,
    swapped: tuple[int, int] | None = None,
    torques_alone: bool = False,
    late_rows: int = 0,
    late_joint: tuple[int, int] | None = None,
    leap: tuple[int, float] | None = None,
    turn: int | None = None,
    rate_scale: Any = 1.0,
    rate_order: tuple[int, ...] | None = None,
    rate_rows: int = 0,
) -> tuple[Floats, Floats, Floats]:
    """Return positions, velocities and torques as a recorder with a fault of each kind would have them."""
    q, qd, tau = q.copy(), qd.copy(), tau.copy()
    for joint, arrays in (signs or {}).items():
        for name, values in (("q", q), ("q", qd), ("tau", tau)):
            if name in arrays.split():
                values[:, joint] *= -1.0
    for joint, zero in (zeros or {}).items():
        q[:, joint] += zero
    if swapped is not None:
        for values in (tau,) if torques_alone else (q, qd, tau):
            values[:, list(swapped)] = values[:, list(swapped)[::-1]]
    qd = np.roll(qd * rate_scale, rate_rows, axis=0)
    qd = qd if rate_order is None else qd[:, list(rate_order)]
    later = len(tau) * 9 // 20
    if leap is not None:
        tau[later:, leap[0]] += leap[1]
    if turn is not None:
        tau[later:, turn] *= -1.0
    if late_joint is not None:
        tau[:, late_joint[0]] = np.roll(tau[:, late_joint[0]], late_joint[1])
    if late_rows:
        q, qd, tau = q[late_rows:], qd[late_rows:], tau[:-late_rows]
    return q, qd, tau


def _of_one(n: int, joint: int, value: float) -> Floats:
    return np.where(np.arange(n) == joint, value, 1.0)


def _tilted(deg: float) -> tuple[float, float, float]:
    return 9.81 * np.sin(np.deg2rad(deg)), 0.0, -9.81 * np.cos(np.deg2rad(deg))


_PANDA: dict[str, Any] = {"robot": "panda", "seed": 3}
_GEN3: dict[str, Any] = {"robot": "gen3", "seed": 4}
_UR10E: dict[str, Any] = {"robot": "ur10e", "seed": 2}
_LIMITS = np.array([150.0, 150.0, 150.0, 28.0, 28.0, 28.0])
TRUTHS = (
    Truth("clean UR5e", None),
    Truth("clean UR10e", None, **_UR10E),
    Truth("clean Panda", None, **_PANDA),
    Truth("clean Gen3", None, **_GEN3),
    Truth("8 s", None, seed=5, seconds=8.0),
    Truth("6 s", None, robot="panda", seed=6, seconds=6.0),
    Truth("small motion", None, seed=7, motion=0.25),
    Truth("gripper", "load", load=(0.925, (0.0, 0.0, 0.06))),
    Truth("hand of a Panda", "load", load=(0.73, (0.0, 0.0, 0.06)), **_PANDA),
    Truth("3 kg on a UR10e", "load", load=(3.0, (0.05, 0.0, 0.1)), **_UR10E),
    Truth("gripper of a Gen3", "load", load=(0.8, (0.0, 0.0, 0.06)), **_GEN3),
    Truth("gravity taken out, UR5e", "no gravity", gravity=(0.0, 0.0, 0.0)),
    Truth("gravity taken out, Panda", "no gravity", gravity=(0.0, 0.0, 0.0), **_PANDA),
    Truth("J3 backwards", "backwards", (2,), spoil={"signs": {2: "q tau"}}),
    Truth("J5 backwards", "backwards", (4,), spoil={"signs": {4: "q tau"}}),
    Truth("J4 of a Panda backwards", "backwards", (3,), spoil={"signs": {3: "q tau"}}, **_PANDA),
    Truth("J2's position backwards", "position sign", (1,), spoil={"signs": {1: "q"}}),
    Truth("J2 10 deg off", "zero", (1,), spoil={"zeros": {1: np.deg2rad(10.0)}}),
    Truth("J3 20 deg off", "zero", (2,), spoil={"zeros": {2: np.deg2rad(20.0)}}),
    Truth("J2 90 deg off", "zero", (1,), spoil={"zeros": {1: np.pi / 2.0}}),
    Truth("J4 90 deg off", "zero", (3,), spoil={"zeros": {3: np.pi / 2.0}}),
    Truth("J4 of a Panda 15 deg off", "zero", (3,), spoil={"zeros": {3: np.deg2rad(15.0)}}, **_PANDA),
    Truth("base tilted by 5 deg", "tilt", gravity=_tilted(5.0), **_UR10E),
    Truth("base tilted by 14 deg", "tilt", gravity=_tilted(14.0), **_UR10E),
    Truth("on a wall", "tilt", gravity=(9.81, 0.0, 0.0)),
    Truth("J3 times 1.25", "gain", (2,), gain=_of_one(6, 2, 1.25), **_UR10E),
    Truth("J5 times 1.6", "gain", (4,), gain=_of_one(6, 4, 1.6), **_UR10E),
    Truth("J2 of a Panda times 1.25", "gain", (1,), gain=_of_one(7, 1, 1.25), **_PANDA),
    Truth("mNm", "common gain", tuple(range(6)), gain=1000.0),
    Truth("percent", "currents", tuple(range(6)), gain=100.0 / _LIMITS),
    Truth("currents", "currents", tuple(range(6)), gain=1.0 / np.array([11.0, 12.0, 10.0, 6.0, 7.0, 7.0])),
    Truth("all signs", "all signs", tuple(range(6)), gain=-1.0),
    Truth("J2's sign", "sign", (1,), gain=_of_one(6, 1, -1.0)),
    Truth("J6's sign", "sign", (5,), gain=_of_one(6, 5, -1.0)),
    Truth("torques of J2 and J3 swapped", "swapped", (1, 2), spoil={"swapped": (1, 2), "torques_alone": True}),
    Truth("J5 and J6 swapped", "swapped", (4, 5), spoil={"swapped": (4, 5)}),
    Truth("coupled wrist", "shared drive", (4, 5), coupled=1.2),
    Truth("40 ms late", "delay", spoil={"late_rows": 8}),
    Truth("J3 50 ms late", "delay", (2,), spoil={"late_joint": (2, 10)}, **_UR10E),
    Truth("half of gravity taken out", "no gravity", gravity=(0.0, 0.0, -4.9)),
    Truth("J2's zero leaps by 15 Nm", "zero leaps", (1,), spoil={"leap": (1, 15.0)}),
    Truth("J3's zero of a Panda leaps by 8 Nm", "zero leaps", (2,), spoil={"leap": (2, -8.0)}, **_PANDA),
    Truth("J2's sign turns", "sign turns", (1,), spoil={"turn": 1}, **_UR10E),
    Truth("2 kg taken up", "load changes", taken_up=2.0),
    Truth("velocities in deg/s", "velocities", tuple(range(6)), spoil={"rate_scale": 57.29578}),
    Truth("J3's velocities in deg/s", "velocities", (2,), spoil={"rate_scale": _of_one(6, 2, 57.29578)}, **_UR10E),
    Truth("velocities of J2 and J3 swapped", "velocities", (1, 2), spoil={"rate_order": (0, 2, 1, 3, 4, 5)}),
    Truth("velocities of another time", "velocities", tuple(range(7)), spoil={"rate_rows": 1600}, **_PANDA),
    Truth("velocities 60 ms late", "late velocities", spoil={"rate_rows": 12}, **_UR10E),
    Truth("J1 locked", None, locked=0, **_UR10E),
    Truth("J4 locked", None, locked=3, **_UR10E),
)


def drawn() -> tuple[Truth, ...]:
    """Return forty others, of which nothing was tuned: other arms, masses 5 to 40 % off, friction .7 to 1.6 times."""
    counts = {"gen3": 7, "iiwa14": 7, "ur10e": 6, "panda": 7}
    truths = []
    for k in range(40):
        robot = tuple(counts)[k % 4]
        n, joint = counts[robot], 1 + k // 4 % 3
        every = tuple(range(n))
        pair = (joint, joint + 2)
        faults: tuple[tuple[str, str, tuple[int, ...], dict[str, Any]], ...] = (
            ("load", "load", (), {"load": (1.5, (0.02, 0.0, 0.08))}),
            ("backwards", "backwards", (joint,), {"spoil": {"signs": {joint: "q tau"}}}),
            ("20 deg off", "zero", (joint,), {"spoil": {"zeros": {joint: 0.35}}}),
            ("tilted", "tilt", (), {"gravity": _tilted(12.0)}),
            ("times 1.6", "gain", (joint,), {"gain": _of_one(n, joint, 1.6)}),
            ("negated", "sign", (joint,), {"gain": _of_one(n, joint, -1.0)}),
            ("torques swapped", "swapped", pair, {"spoil": {"swapped": pair, "torques_alone": True}}),
            ("mNm", "common gain", every, {"gain": 1000.0}),
            ("currents", "currents", every, {"gain": 1.0 / np.linspace(14.0, 7.0, n)}),
            ("all negated", "all signs", every, {"gain": -1.0}),
            ("30 ms late", "delay", (), {"spoil": {"late_rows": 6}}),
            ("gravity taken out", "no gravity", (), {"gravity": (0.0, 0.0, 0.0)}),
            ("swapped", "swapped", pair, {"spoil": {"swapped": pair}}),
            ("on a wall", "tilt", (), {"gravity": (0.0, 9.81, 0.0)}),
        )
        words, cause, joints, what = faults[k % len(faults)] if k >= 12 else ("sound", None, (), {})
        how: dict[str, Any] = {
            "robot": robot, "seed": 200 + k, "masses": (0.05, 0.12, 0.2, 0.3, 0.4)[k % 5],
            "friction": (0.7, 1.0, 1.6)[k % 3], "seconds": (40.0, 20.0, 30.0)[k % 3],
        }  # fmt: skip
        truths.append(Truth(f"{k}, {robot} {words}", cause, joints, **how, **what))
    return tuple(truths)
