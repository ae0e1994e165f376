"""The simulated RAVEN-II: hours in compiled runs with the firmware inside, and single ticks."""

from functools import partial

import numpy as np

from catenary import CablePlant, go_to, random_sinusoids, zigzag
from catenary.simulation.simulated_plant import PERIOD
from catenary.trajectories.reference import Trajectory
from tests.benchmarks.measure import Table, Tables, cpu_time, report, side_by_side

PIECE = 60_000  # ticks in a call
JOINTS = 3  # that move; the tool stays


def homed(substeps: int) -> CablePlant:
    """Return an arm, homed and enabled."""
    plant = CablePlant(substeps=substeps)
    plant.home()
    return plant


def moved_along(plant: CablePlant, trajectory: Trajectory) -> float:
    """Run a motion from its beginning to its end, the log of every tick included; returns the CPU time [s]."""
    ticks, spent = round(trajectory.duration / PERIOD), 0.0
    for first in range(0, ticks, PIECE):
        times = np.arange(first, min(first + PIECE, ticks)) * PERIOD
        rows = np.full((len(times), 7), np.nan)
        rows[:, :JOINTS] = trajectory.sample(times)[0]
        spent += cpu_time(partial(plant.run, rows))
    return spent


def run_of(trajectory: Trajectory, substeps: int) -> dict[str, float]:
    """Time a motion."""
    plant, start = homed(substeps), trajectory(0.0).q
    fastest, strongest = [0.2, 0.2, 0.01], [0.5, 0.5, 0.05]
    here = plant.control.setpoint[:JOINTS]
    moved_along(plant, go_to(here, start, max_velocity=fastest, max_acceleration=strongest))
    spent, duration = moved_along(plant, trajectory), trajectory.duration
    speed = {"times_real_time": duration / spent, "us_per_tick": 1e6 * spent / (duration / PERIOD)}
    return {"simulated_s": duration, "cpu_s": spent, **speed}


def cable_tables() -> Tables:
    """Time runs, and what a loop calls in a tick of 1 ms."""
    plant = homed(2)
    wanted = plant.setpoint_js().q

    def tick() -> None:
        plant.servo_jp(wanted)
        plant.wait()

    calls = {"wait": plant.wait, "servo_jp and wait": tick}
    calls |= {"measured_js": plant.measured_js, "telemetry": plant.telemetry}
    rng = np.random.default_rng(0)
    runs: Table = {
        "zig-zag of 17 minutes, 2 substeps": run_of(zigzag("J2-J3", [1 / 2, 1 / 3, 1 / 4]), 2),
        "random motion of six hours, 1 substep": run_of(random_sinusoids(rng, 6.0 * 3600.0), 1),
    }
    return {"RAVEN-II, runs": runs, "RAVEN-II, ticks": side_by_side(calls, calls=2000)}


if __name__ == "__main__":
    report(cable_tables, __doc__)
