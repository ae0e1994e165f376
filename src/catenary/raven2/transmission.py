"""Nominal transmission of the RAVEN-II: ratios, coupling, encoder counts, joint torques."""

import math
from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.raven2.topics import JOINTS
from catenary.transmission.cable_elasticity import joint_forces

# motor motion per joint motion [rad/rad], [rad/rad], [rad/m] [raven2 source: transmission ratios]
_RATIO: Mapping[str, float] = {"shoulder": 136.1963, "elbow": 121.5221, "insertion": 2158.590}
CALIBRATED = tuple(_RATIO)  # names of the calibrated joints: the positioning joints
# c01, c02, c12 [raven2 source] rad/rad, m/rad, m/rad
COUPLING = np.array([0.14545, 0.0077973826, 0.008077387])
# cable torque or tension = torque at the gearbox's output * ratio / gearbox [raven2 source: transmission ratios; RE40
# with 49/4, RE30 with 26/7]; joint torques follow through the cables' coupling
JOINT_TORQUE: Mapping[str, float] = {
    **{joint: ratio / 12.25 for joint, ratio in _RATIO.items()},  # [1], [1], [1/m]
    "roll": 5.395176 * 7 / 26, "wrist": 8.991960 * 7 / 26, "jaw1": 8.991960 * 7 / 26, "jaw2": 8.991960 * 7 / 26,
}  # fmt: skip
COUNTS_PER_RADIAN = 4000.0 / (2.0 * math.pi)  # of the motor's encoder
_TORQUE_RATIO = np.array([JOINT_TORQUE[name] for name in JOINTS])
OFFSETS = "encoffsets:"  # prefix of the signals in a motion log that homing writes


def nominal_joint_torques(tau: Floats) -> Floats:
    """Return joint torques (7,) [Nm, Nm, N, Nm...], as in a motion log, from those at the gearboxes' outputs [Nm]."""
    torques: Floats = tau * _TORQUE_RATIO
    torques[: len(CALIBRATED)] = joint_forces(COUPLING, (torques[0], torques[1], torques[2]))
    return torques
