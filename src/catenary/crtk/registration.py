"""The registration that a homing of a RAVEN-II wrote, out of its telemetry."""

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.raven_conversions import arm_channels
from catenary.crtk.reader import CrtkReader
from catenary.errors import TransportError
from catenary.plant import Plant
from catenary.recording.raven_transmission import RATIO, shift_of
from catenary.recording.topics import Arm

COLUMN = "encoffsets"
BOTH_ARMS = 16  # channels of raven_state


def registration_of(plant: Plant) -> Floats | None:
    """Return `shift_of` of a robot's encoder offsets, (3,) [rad, rad, m]; None of one that tells none, or of NaN.

    Args:
        plant: A simulated arm, whose telemetry has seven axes, or one behind topics, which has both arms' channels.
    """
    offsets = plant.telemetry().get(COLUMN)
    if offsets is None:
        return None
    arm: Arm = plant.arm if isinstance(plant, CrtkReader) else "gold"
    own = arm_channels(offsets, arm) if len(offsets) == BOTH_ARMS else offsets
    shift = shift_of(own[: len(RATIO)])
    return shift if np.isfinite(shift).all() else None


def registration_heard(plant: Plant) -> Floats | None:
    """Return `registration_of` of a robot; None also while its raven_state has not come yet."""
    try:
        return registration_of(plant)
    except TransportError:
        return None
