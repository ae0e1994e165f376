"""Pushes of 15 N on identified arms that move, and an hour of free motion: python -m tests.benchmarks.pushed_arms [MINUTES [ARM ...]]."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.external_torque import MomentumObserver
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.kinematics import jacobian
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from moving_arm import SLOW, recorded, sinusoids

PUSHED_HZ, FREE_HZ = 125.0, 50.0  # of states with pushes, as of a UR10, and without: the observer's filter has 10 Hz
PIECE, PUSHES, FORCE = 60.0, 78, 15.0  # [s] of one motion, pushes, [N]
LASTS, SOON = 0.5, 0.05  # [s] of a push, and within which it has to be detected


@dataclass(frozen=True)
class Arm:
    """A robot whose torques have friction, noise, and a ripple that no model of it knows."""

    robot: str
    coulomb: float  # [Nm]
    noise: float  # [Nm] standard deviation of each torque
    ripple: float  # [Nm]

    def moves(self, seed: int, rate: float, seconds: float = PIECE) -> MotionLog:
        """Return a motion at up to some 2 rad/s, with torques as measured where nothing touches the arm."""
        model, rng = load_robot(self.robot), np.random.default_rng(seed)
        time = np.arange(round(seconds * rate)) / rate
        q, qd, qdd = (SLOW**k * rows for k, rows in enumerate(sinusoids(rng, model, SLOW * time)))
        tau = inverse_dynamics(model, q, qd, qdd, LEVEL) + self.coulomb * np.tanh(qd / 0.002) + 0.3 * qd
        tau += self.ripple * np.sin(8.0 * q) + rng.normal(0.0, self.noise, q.shape)
        qd = qd + rng.normal(0.0, 1e-3, q.shape)
        return replace(recorded(model, seed, seconds=0.1), q_nominal=q, qd=qd, tau=tau, ok=time >= 0.0, time=time)

    def observer(self) -> MomentumObserver:
        """Return the observer of the arm as identified from two recordings."""
        logs = [self.moves(seed, 100.0, 30.0) for seed in (0, 2)]
        robot = identify(logs, load_robot(self.robot), IdentifyOptions(friction=())).robot()
        return MomentumObserver(robot, loads=known_loads(robot))

    def teach(self, observer: MomentumObserver, rate: float) -> None:
        """Let an observer learn its deviation from a recording that was held out, at a rate [Hz]."""
        free = self.moves(4, rate, 30.0)
        assert free.q_nominal is not None
        assert free.qd is not None
        assert free.tau is not None
        observer.learn(free.q_nominal, free.qd, free.tau, LEVEL, 1.0 / rate)


ARMS = {"panda": Arm("panda", 0.5, 0.3, 0.2), "ur10": Arm("ur10", 12.0, 2.0, 0.5)}


def looked(
    observer: MomentumObserver, log: MotionLog, begins: Floats, pushes: Floats
) -> tuple[list[float], float, int]:
    """Follow a motion with pushes (K, 3) [N] at times (K,).

    Returns:
        Delays of those that were detected [s]; the largest share of the bound, and false alarms, away from pushes.
    """
    observer.reset()
    delays, largest, alarms, is_alarmed = dict[int, float](), 0.0, 0, False
    dt = float(log.time[1] - log.time[0])
    for time, q, qd, tau in zip(log.time, log.q_nominal, log.qd, log.tau, strict=True):
        since = time - begins
        acts = np.flatnonzero((since >= 0.0) & (since < LASTS))
        touch = jacobian(observer.model, q)[:3].T @ pushes[acts[0]] if len(acts) else 0.0
        observer.update(q, qd, tau - touch, LEVEL, dt)
        if len(acts):
            if observer.collided:
                delays.setdefault(int(acts[0]), float(since[acts[0]]))
        elif not ((since >= LASTS) & (since < 2.0 * LASTS)).any():
            beyond = np.maximum(np.abs(observer.torque) - observer.sticking, 0.0) / observer.deviation
            largest = max(largest, float(np.linalg.norm(beyond)))
            alarms += bool(observer.collided) and not is_alarmed
            is_alarmed = bool(observer.collided)
    return list(delays.values()), largest, alarms


def main(minutes: int, names: Sequence[str]) -> None:
    """Print two lines of each arm."""
    for name in names or ARMS:
        arm = ARMS[name]
        observer, rng = arm.observer(), np.random.default_rng(1)
        begins = 2.0 + 2.0 * np.arange(PUSHES)
        ways = rng.normal(size=(PUSHES, 3))
        ways *= FORCE / np.linalg.norm(ways, axis=1)[:, None]
        arm.teach(observer, PUSHED_HZ)
        delays, _, _ = looked(observer, arm.moves(5, PUSHED_HZ, begins[-1] + 2.0), begins, ways)
        soon = sum(delay < SOON for delay in delays)
        print(f"{name}: {soon} of {PUSHES} within {SOON:g} s, median {1e3 * np.median(delays):.0f} ms", flush=True)
        arm.teach(observer, FREE_HZ)
        none = np.zeros(0), np.zeros((0, 3))
        free = [looked(observer, arm.moves(7 + 2 * k, FREE_HZ), *none) for k in range(minutes)]
        largest, alarms = max((row[1] for row in free), default=0.0), sum(row[2] for row in free)
        print(f"{name}: {alarms} false alarms in {minutes} min; largest {largest:.1f} standard deviations", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60, sys.argv[2:])
