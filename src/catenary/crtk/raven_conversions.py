"""`raven_state` to SI and back, by the one table of its traps, `recording.topics`.

The traps: every position and velocity is multiplied by 180/pi, metres of insertion too; `pos` is in whole micrometres;
`tau` is what was commanded. Arms come as 8 channels each, gold first.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, header, message_class
from catenary.errors import InputError
from catenary.recording.topics import RAVENSTATE, Arm

_COLUMNS = {column.name: column for column in RAVENSTATE.columns}
# channels of measured_js's joints: shoulder, elbow, insertion, roll, wrist, two jaws
CHANNELS: Mapping[Arm, tuple[int, ...]] = {
    "gold": (0, 1, 2, 4, 5, 6, 7),
    "green": (8, 9, 10, 12, 13, 14, 15),
}


def raven_state_message(columns: Mapping[str, Floats], stamp: int, *, frame_id: str = "") -> Message:
    """Return a raven_2/raven_state.

    Args:
        columns: By the name of raven_state's fields, each (width,) in SI; what is missing is sent as zero, as the robot
            sends what it does not know.
        stamp: [ns].
        frame_id: Of the header.

    Raises:
        InputError: A column is unknown, of another width, or holds what its field cannot.
    """
    fields: dict[str, Any] = {}
    for name, given in columns.items():
        column = _COLUMNS.get(name)
        if column is None:
            raise InputError(f'raven_state: no field "{name}"; there are {", ".join(_COLUMNS)}')
        values = as_array(f"raven_state.{name}", given, (column.width,)) / column.to_si
        if name == "dt":
            fields[name] = round(float(values[0]) * SECOND)
            continue
        if column.whole or column.to_si == 1e-6:
            values = np.rint(values)
            if np.abs(values).max() > np.iinfo(np.int32).max:
                raise InputError(f"raven_state.{name}: {values.tolist()} does not fit into 32 bits")
            fields[name] = values.astype(np.int32)
        else:
            fields[name] = values.astype(np.float32)
        if column.labels == ("",):
            fields[name] = fields[name].item()
    return message_class("raven_2/raven_state")(hdr=header(stamp, frame_id), **fields)


def raven_state_columns(message: Message) -> dict[str, Floats]:
    """Return raven_state's fields in SI, each (width,)."""
    return {name: raven_state_column(message, name) for name in _COLUMNS}


def raven_state_column(message: Message, name: str) -> Floats:
    """Return one of raven_state's fields in SI, (width,)."""
    values = np.atleast_1d(np.asarray(getattr(message, name), dtype=np.float64))
    return values / SECOND if name == "dt" else values * _COLUMNS[name].to_si


def arm_channels(values: Floats, arm: Arm) -> Floats:
    """Seven joints of one arm, in the order of measured_js, out of 16 channels.

    Raises:
        InputError: Not 16 numbers, or no such arm.
    """
    if arm not in CHANNELS:
        raise InputError(f'arm "{arm}": expected {" or ".join(CHANNELS)}')
    return as_array("channels", values, (16,), finite=False).take(CHANNELS[arm])
