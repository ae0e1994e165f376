"""What a simulated arm reports besides its joint state: the columns of its telemetry."""

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Column
from catenary.simulation.base_motion import BaseSamples, imu_reading
from catenary.simulation.external_encoders import ExternalEncoders
from catenary.simulation.firmware import ControlState
from catenary.simulation.records import AXES, POSITIONING

# name in telemetry: field of the firmware's state, unit
_FROM_CONTROL = {
    "encVals": ("counts", "counts"),
    "mpos": ("motor", "rad"),
    "mvel": ("motor_velocity", "rad/s"),
    "jpos": ("joint", "rad|m"),
    "jvel": ("joint_velocity", "rad/s|m/s"),
    "jpos_d": ("setpoint", "rad|m"),
    "mpos_d": ("motor_setpoint", "rad"),
    "tau": ("torque", "Nm at the gearbox's output"),
    "dac_val": ("dac", "DAC"),
    "encoffsets": ("offset", "counts"),
}
CONTROL_FIELDS = {name: field for name, (field, _) in _FROM_CONTROL.items()}
COLUMNS = (
    *(Column(name, unit, AXES) for name, (_, unit) in _FROM_CONTROL.items()),
    Column("joint_enc", "counts", POSITIONING),
    Column("ext_jpos", "rad|m", POSITIONING),
    Column("q_true", "rad|m", POSITIONING),
    Column("accelerometer", "m/s2", 3),
    Column("gyroscope", "rad/s", 3),
)


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
