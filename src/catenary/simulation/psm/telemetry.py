"""A simulated PSM's ticks as it reports them: what its topics carry, and what a tracker sees, in SI."""

import numpy as np

from catenary.arrays import Floats
from catenary.simulation.psm.controller import PsmLog
from catenary.simulation.psm.parameters import ARM_JOINTS
from catenary.simulation.psm.plant import PsmPlant

PSM_COLUMNS = ("measured_js", "measured_js_velocity", "measured_js_effort", "setpoint_js", "ext_jpos")


def psm_telemetry(plant: PsmPlant, log: PsmLog) -> dict[str, Floats]:
    """Return T ticks of a run as telemetry: column name to (T, 6), without the jaw."""
    measured = (log.joint, log.joint_velocity, log.torque, log.setpoint)
    columns = {
        name: values[:, :ARM_JOINTS].copy() for name, values in zip(PSM_COLUMNS, measured, strict=False)
    }
    return {**columns, "ext_jpos": plant.seen(log.q, plant.ticks - np.arange(len(log.q), 0, -1))}
