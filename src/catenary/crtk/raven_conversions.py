"""`raven_state` to SI, by the one table of its traps, `recording.topics`.

The traps: every position and velocity is multiplied by 180/pi, metres of insertion too; `pos` is in whole micrometres;
`tau` is what was commanded. Arms come as 8 channels each, gold first.
"""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message
from catenary.errors import InputError
from catenary.recording.topics import RAVENSTATE, Arm

_COLUMNS = {column.name: column for column in RAVENSTATE.columns}
# channels of measured_js's joints: shoulder, elbow, insertion, roll, wrist, two jaws
CHANNELS: Mapping[str, tuple[int, ...]] = {
    "gold": (0, 1, 2, 4, 5, 6, 7),
    "green": (8, 9, 10, 12, 13, 14, 15),
}


def raven_state_columns(message: Message) -> dict[str, Floats]:
    """Return raven_state's fields in SI, each (width,)."""
    return {name: raven_state_column(message, name) for name in _COLUMNS}


def raven_state_column(message: Message, name: str) -> Floats:
    """Return one of raven_state's fields in SI, (width,)."""
    values = np.atleast_1d(np.asarray(getattr(message, name), dtype=np.float64))
    return values / SECOND if name == "dt" else values * _COLUMNS[name].to_si


def arm_channels(values: Floats, arm: Arm) -> Floats:
    """Return the seven joints of one arm, in the order of measured_js, out of 16 channels."""
    if arm not in CHANNELS:
        raise InputError(f'arm "{arm}": expected {" or ".join(CHANNELS)}')
    return as_array("channels", values, (16,), finite=False).take(CHANNELS[arm])
