"""What a simulated arm reports besides its joint state: the columns of its telemetry."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from catenary.arrays import Floats
from catenary.plant import Column
from catenary.simulation.base_motion import BaseSamples, imu_reading

if TYPE_CHECKING:
    from catenary.simulation.cable_plant import CablePlant

COLUMNS = (
    Column("encVals", "counts", 7),
    Column("mpos", "rad", 7),
    Column("mvel", "rad/s", 7),
    Column("jpos", "rad|m", 7),
    Column("jvel", "rad/s|m/s", 7),
    Column("jpos_d", "rad|m", 7),
    Column("mpos_d", "rad", 7),
    Column("tau", "Nm at the gearbox's output", 7),
    Column("dac_val", "DAC", 7),
    Column("encoffsets", "counts", 7),
    Column("joint_enc", "counts", 3),
    Column("ext_jpos", "rad|m", 3),
    Column("q_true", "rad|m", 3),
    Column("accelerometer", "m/s2", 3),
    Column("gyroscope", "rad/s", 3),
)


def sample(plant: "CablePlant", base: BaseSamples) -> Mapping[str, Floats]:
    """Latest sample of every column; `base` is how the base moves now, one row."""
    c = plant.control
    counts = plant.rig_counts(plant.state.q)
    specific_force, rate = imu_reading(base)
    return {
        "encVals": c.counts.copy(),
        "mpos": c.motor.copy(),
        "mvel": c.motor_velocity.copy(),
        "jpos": c.joint.copy(),
        "jvel": c.joint_velocity.copy(),
        "jpos_d": c.setpoint.copy(),
        "mpos_d": c.motor_setpoint.copy(),
        "tau": c.torque.copy(),
        "dac_val": c.dac.copy(),
        "encoffsets": c.offset.copy(),
        "joint_enc": counts,
        "ext_jpos": plant.rig_positions(counts),
        "q_true": plant.state.q.copy(),
        "accelerometer": specific_force[0].copy(),  # an ideal one at the base's origin, in base axes
        "gyroscope": rate[0].copy(),
    }
