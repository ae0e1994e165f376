"""What an arm says of its joints, in one compiled call: a robot that is served is asked twice in every tick."""

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled_quick
from catenary.plant import JointState
from catenary.simulation.base_motion import BaseSamples
from catenary.simulation.packed import control_of, firmware_of
from catenary.transmission.coupling import joint_forces

_NUMBERS = 37  # four rows of the joints, gravity, the base's rates


def joint_state(
    time: float,
    firmware: Floats,
    control: tuple[Floats, NDArray[np.int64]],
    base: BaseSamples,
    *,
    measured: bool,
) -> JointState:
    """Give an arm's joint state as measured, or as set.

    Args:
        time: [s]
        firmware: Its parameters, packed.
        control: Its state, packed: numbers, whole numbers.
        base: How the base moves now, one row; sensors at its origin are ideal.
        measured: Whether the encoders' or the setpoint.
    """
    out = np.empty(_NUMBERS)
    report_joints(firmware, *control, base.gravity, base.motion, measured, out)
    return JointState(
        time, out[:7], out[7:14], out[14:21], out[21:28], out[28:31], 0.0, out[31:].reshape(2, 3)
    )


@compiled_quick
def report_joints(
    firmware_numbers: Floats,
    control_numbers: Floats,
    control_whole: NDArray[np.int64],
    gravity: Floats,
    motion: Floats,
    measured: bool,
    out: Floats,
) -> None:
    """Write positions, velocities, torques and motor positions, gravity as it is felt and the base's rates, (37,).

    Torques are as `firmware.joint_torques` gives them.
    """
    firmware, control = firmware_of(firmware_numbers), control_of(control_numbers, control_whole)
    for j in range(7):
        out[j] = control.joint[j] if measured else control.setpoint[j]
        out[7 + j] = control.joint_velocity[j] if measured else 0.0
        out[14 + j] = control.torque[j] * firmware.ratio[j] / firmware.gearbox[j]
        out[21 + j] = control.motor[j]
    out[14], out[15], out[16] = joint_forces(firmware.coupling, (out[14], out[15], out[16]))
    for r in range(3):
        # an accelerometer cannot tell one from the other
        out[28 + r] = gravity[0, r] - motion[0, 2, r]
        out[31 + r], out[34 + r] = motion[0, 0, r], motion[0, 1, r]
