"""What a simulated arm reports besides its joint state: the columns of its telemetry."""

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Column
from catenary.simulation.base_motion import BaseSamples, imu_reading
from catenary.simulation.external_encoders import ExternalEncoders
from catenary.simulation.firmware import ControlState

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

# name in telemetry: field of the firmware's state
CONTROL_FIELDS = {
    "encVals": "counts",
    "mpos": "motor",
    "mvel": "motor_velocity",
    "jpos": "joint",
    "jvel": "joint_velocity",
    "jpos_d": "setpoint",
    "mpos_d": "motor_setpoint",
    "tau": "torque",
    "dac_val": "dac",
    "encoffsets": "offset",
}


def sample(
    control: ControlState, q: Floats, encoders: ExternalEncoders, base: BaseSamples
) -> dict[str, Floats]:
    """Return every column at one instant, as copies.

    Args:
        control: The firmware's state.
        q: (3,) where the joints really are [rad, rad, m].
        encoders: Of the rig.
        base: How the base moves, one row; its ideal accelerometer and gyroscope are at its origin, in base axes.
    """
    specific_force, rate = imu_reading(base)
    counts = encoders.counts(q)
    own = control.copy().view(np.ndarray)
    return {
        **{column: own[field] for column, field in CONTROL_FIELDS.items()},
        "joint_enc": counts,
        "ext_jpos": encoders.positions(counts),
        "q_true": q.copy(),
        "accelerometer": specific_force[0],
        "gyroscope": rate[0].copy(),
    }
