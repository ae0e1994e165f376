"""A whole tick of the control loop on a plant that takes no time: state, correction, PD, limits."""

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.control.limits import TorqueLimits
from catenary.control.loop import run_loop
from catenary.control.pd import JointPD
from catenary.plant import JointState
from catenary.trajectories.reference import Reference, Trajectory
from tests.benchmarks.inference import INPUTS, JOINTS, model_of
from tests.benchmarks.measure import ROUNDS, tell
from tests.oracles.calibration_models import random_network, random_predictor
from tests.oracles.mass_plant import MassPlant

N = INPUTS // 2
SECONDS = 5.0


class Instant(MassPlant):
    """Stands still, and takes commands without a thought."""

    def __init__(self) -> None:
        super().__init__(np.zeros(N))
        self.joint_units = tuple("m" if j % 3 == 2 else "rad" for j in range(N))
        zero = np.zeros(N)
        self.reported = JointState(0.0, zero, zero, zero, np.zeros(0), np.array([0.0, 0.0, -9.81]), np.inf)

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


def main() -> None:
    """Time the tick with several models, in simulated and in real time."""
    rng = np.random.default_rng(0)
    predictors = {
        "no model": None,
        f"linear {INPUTS}-{JOINTS}": random_predictor("linear", INPUTS, JOINTS, rng),
        f"network {INPUTS}-100-100-{JOINTS}": random_network((INPUTS, 100, 100, JOINTS), "tanh", rng),
    }
    pd = JointPD(np.full(N, 100.0), np.full(N, 10.0))
    limits = TorqueLimits(
        np.full(N, 9.0),
        slew=np.full(N, 1e3),
        lower=np.full(N, -3.0),
        upper=np.full(N, 3.0),
        taper=np.full(N, 0.1),
    )
    tables: dict[str, dict[str, dict[str, float]]] = {
        "compute time of a tick, us": {},
        "1 kHz real time, us": {},
    }
    for name, predictor in predictors.items():
        corrector = None if predictor is None else Corrector(model_of(predictor, rng))
        runs = [run_loop(Instant(), pd, Rest(), limits=limits, corrector=corrector) for _ in range(ROUNDS)]
        times = [run.compute for run in runs if run.compute is not None]
        tables["compute time of a tick, us"][name] = {
            key: 1e6 * float(np.median([getattr(t, key) for t in times]))
            for key in ("median", "p99", "p999", "max")
        }
        real = run_loop(Instant(), pd, Rest(), limits=limits, corrector=corrector, real_time=True)
        assert real.compute is not None
        assert real.jitter is not None
        assert real.overruns is not None
        tables["1 kHz real time, us"][name] = {
            **{f"compute {key}": 1e6 * getattr(real.compute, key) for key in ("median", "p99")},
            **{f"jitter {key}": 1e6 * getattr(real.jitter, key) for key in ("median", "p99", "p999", "max")},
            "overruns": float(real.overruns),
            "priority": float(real.has_priority),
        }
    tell(tables)


if __name__ == "__main__":
    main()
