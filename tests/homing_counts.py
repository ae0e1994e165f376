"""What the encoders of a simulated arm count while it homes and moves on."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.simulation.cable_plant import CablePlant


class HomingCounts(NamedTuple):
    """Rows of T instants."""

    time: NDArray[np.float64]  # (T,) [s]
    counts: NDArray[np.float64]  # (T, 3)
    busy: NDArray[np.bool_]  # (T,) homing
    homed: NDArray[np.bool_]  # (T,)
    ext_jpos: NDArray[np.float64]  # (T, 3) the rig's own registration; NaN before it


@cache
def homing_counts(every: int = 4) -> HomingCounts:
    """An arm that homes and then moves 0.1 rad, 0.1 rad, 20 mm to and fro, sampled every so many ms."""
    plant = CablePlant(start=np.array([0.3, 1.7, 0.45]))
    plant.state_command("enable")
    plant.state_command("home")
    rows = []

    def look() -> None:
        state = plant.operating_state()
        counts = plant.encoders.counts(plant.state.q)
        rows.append([plant.time, *counts, state.is_busy, state.is_homed, *plant.encoders.positions(counts)])

    look()
    while plant.operating_state().is_busy:
        for _ in range(every):
            plant.wait()
        look()
    home = plant.measured_js().q
    for phase in np.linspace(0.0, 2.0 * np.pi, 1000 // every):
        target = home.copy()
        target[:3] += np.array([0.1, 0.1, 0.02]) * np.sin(phase)
        for _ in range(every):
            plant.servo_jp(target)
            plant.wait()
        look()
    table = np.array(rows, dtype=float)
    return HomingCounts(table[:, 0], table[:, 1:4], table[:, 4] > 0.5, table[:, 5] > 0.5, table[:, 6:9])
