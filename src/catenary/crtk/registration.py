"""The registration that a homing of a RAVEN-II wrote, out of its telemetry."""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.raven_conversions import arm_channels
from catenary.recording.raven_transmission import RATIO, shift_of
from catenary.recording.topics import Arm

COLUMN = "encoffsets"
BOTH_ARMS = 16  # channels of raven_state


def registration_of(telemetry: Mapping[str, Floats], arm: Arm = "gold") -> Floats | None:
    """Return `shift_of` of a robot's encoder offsets, (3,) [rad, rad, m]; None of one that tells none, or of NaN.

    Args:
        telemetry: Of a simulated arm, seven axes, or of raven_state, both arms' channels.
        arm: Which of both.
    """
    offsets = telemetry.get(COLUMN)
    if offsets is None:
        return None
    own = arm_channels(offsets, arm) if len(offsets) == BOTH_ARMS else offsets
    shift = shift_of(own[: len(RATIO)])
    return shift if np.isfinite(shift).all() else None
