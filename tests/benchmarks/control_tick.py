"""A whole tick of `run_loop` on a Panda-sized arm whose plant takes no time: state, correction, controller, limits."""

from dataclasses import replace

import numpy as np

from catenary import Corrector, GravityPD, JointPD, JointState, Reference, TorqueLimits, run_loop
from catenary.arrays import Floats
from catenary.control.pd import Controller
from catenary.trajectories.reference import Trajectory
from tests.benchmarks.measure import ROUNDS, Tables, report
from tests.benchmarks.robots import robots
from tests.oracles.calibration_models import random_model, random_network
from tests.oracles.ideal_plant import MassPlant

N = 7
SECONDS = 5.0


class StillPlant(MassPlant):
    """Stands still, and takes commands without doing anything."""

    def __init__(self, base_rates: Floats) -> None:
        super().__init__(np.zeros(N))
        self.joint_units = tuple("m" if j % 3 == 2 else "rad" for j in range(N))
        zero, down = np.zeros(N), np.array([0.0, 0.0, -9.81])
        self.reported = JointState(0.0, zero, zero, zero, np.zeros(0), down, 0.0, base_rates)

    def measured_js(self) -> JointState:
        return self.reported

    def servo_jf(self, tau: Floats) -> None:
        pass

    def wait(self) -> None:
        pass


class Rest(Trajectory):
    """Zero."""

    reference = Reference(np.zeros(N), np.zeros(N), np.zeros(N))
    duration = SECONDS

    def __call__(self, t: float) -> Reference:
        return self.reference


def network_corrector() -> Corrector:
    """Return a network of positions and torques of all joints, with two layers of a hundred."""
    rng = np.random.default_rng(0)
    model = random_model("linear", rng.normal(size=(2000, 2 * N)), rng, joints=N, torques=N)
    network = random_network((2 * N, 100, 100, N), "tanh", rng)
    return Corrector(replace(model, groups=(replace(model.groups[0], predictor=network),)))


def tables() -> Tables:
    """Time ticks in simulated and in real time."""
    kp, kd = np.full(N, 100.0), np.full(N, 10.0)
    gravity_pd = GravityPD(robots()["Panda-like, 7 joints"].model, kp, kd)
    largest, slew, upper, taper = (np.full(N, value) for value in (9.0, 1e3, 3.0, 0.1))
    limits = TorqueLimits(largest, slew=slew, lower=-upper, upper=upper, taper=taper)
    at_rest, turning, corrector = np.zeros((2, 3)), np.full((2, 3), 0.1), network_corrector()
    cases: dict[str, tuple[Controller, Corrector | None, Floats]] = {
        "PD": (JointPD(kp, kd), None, at_rest),
        "PD and gravity": (gravity_pd, None, at_rest),
        f"PD and gravity, network {2 * N}-100-100-{N}": (gravity_pd, corrector, at_rest),
        "the same on a base that turns": (gravity_pd, corrector, turning),
    }
    compute, real_time = {}, {}
    for name, (controller, correct, rates) in cases.items():
        plant = StillPlant(rates)
        runs = [run_loop(plant, controller, Rest(), limits=limits, corrector=correct) for _ in range(ROUNDS)]
        times = [run.compute for run in runs if run.compute is not None]
        quantiles = ("median", "p99", "p999", "max")
        compute[name] = {q: 1e6 * float(np.median([getattr(t, q) for t in times])) for q in quantiles}
        real = run_loop(plant, controller, Rest(), limits=limits, corrector=correct, real_time=True)
        real_time[name] = {
            **{f"compute {key}": 1e6 * getattr(real.compute, key) for key in ("median", "p99")},
            **{f"jitter {key}": 1e6 * getattr(real.jitter, key) for key in quantiles},
            "overruns": float(real.overruns),
            "priority": float(real.has_priority),
        }
    return {"compute time of a tick, us": compute, "1 kHz real time, us": real_time}


if __name__ == "__main__":
    report(tables, __doc__)
