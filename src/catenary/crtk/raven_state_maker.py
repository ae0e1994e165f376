"""`/ravenstate` from served arms: the robot's whole state in its own units, quickly enough for every millisecond."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.crtk.frames import frame_of, number_view
from catenary.crtk.message import header, message_class
from catenary.crtk.served_arm import ServedArm
from catenary.recording.topics import Arm

_DEGREES = 180.0 / np.pi  # every position and velocity is multiplied by it, metres too
_UM = 1e6
_PLACE: dict[Arm, int] = {"gold": 0, "green": 1}
_TYPE = "raven_2/raven_state"
_HOMING = 3  # sublevel in run level init
_SEVEN = 7
# rows of the message, in its order, with what a number in SI is multiplied by
_ROWS = {
    "tau": 1.0, "mpos": _DEGREES, "jpos": _DEGREES, "mvel": _DEGREES, "jvel": _DEGREES, "mpos_d": _DEGREES,
    "jpos_d": _DEGREES,
}  # fmt: skip
_COUNTS = ("encVals", "dac_val")
_SCALE = np.array(list(_ROWS.values()))[:, np.newaxis]
_NONE = np.zeros(_SEVEN)


class RavenStateMaker:
    """Makes the messages; seven-joint arms fill channels, anything else leaves them zero."""

    def __init__(self, arms: dict[Arm, ServedArm], period: float) -> None:
        self._arms = [(name, arm) for name, arm in arms.items() if len(arm.names) == _SEVEN]
        message = message_class(_TYPE)(header(0), dt=round(1e9 * period))
        self._frame = frame_of(_TYPE, message)

        def view(*names: str) -> NDArray[Any]:
            return number_view(self._frame, _TYPE, message, names)

        self._levels = view("runlevel", "sublevel")
        self._numbers, self._counts = view(*_ROWS), view(*_COUNTS)
        self._offsets, self._grasp = view("encoffsets"), view("grasp_d")
        self._places = view("pos"), view("pos_d")
        self._turns = view("ori", "ori_d")
        for name, arm in self._arms:
            self._fill(name, arm)

    def frame(self) -> bytearray:
        """Give the state as the arms last reported it."""
        level = 0
        for name, arm in self._arms:
            if arm.machine.can_change:  # a parked arm's numbers stay
                self._fill(name, arm)
                level = max(level, arm.machine.run_level(arm.state))
        self._levels[0] = level
        self._levels[1] = _HOMING if level == 1 else 0
        return self._frame

    def _fill(self, name: Arm, arm: ServedArm) -> None:
        place, measured, setpoint = _PLACE[name], arm.measured, arm.setpoint
        own = arm.plant.telemetry() if arm.plant.columns else {}
        known = {"jpos": measured.q, "jvel": measured.qd, "jpos_d": setpoint.q}
        rows = [known[row] if row in known else own.get(row, _NONE) for row in _ROWS]
        _set_channels(self._numbers, place, _SCALE * np.array(rows))
        _set_channels(self._counts, place, np.array([own.get(row, _NONE) for row in _COUNTS]))
        _set_channels(self._offsets, place, own.get("encoffsets", _NONE)[np.newaxis])
        self._grasp[0, place] = setpoint.q[-2] + setpoint.q[-1]
        if arm.tool is not None:
            rotations, positions = arm.tool.in_frame_0(*arm.tool_poses())
            # truncated to whole um, as the robot does
            for row, position in zip(self._places, _UM * positions, strict=True):
                row[0, 3 * place : 3 * place + 3] = position
            self._turns[:, 9 * place : 9 * place + 9] = rotations.reshape(2, 9)


def _set_channels(field: NDArray[Any], place: int, values: Floats) -> None:
    """Write seven joints into an arm's eight channels of each row: the fourth is unused."""
    begin = 8 * place
    field[:, begin : begin + 3] = values[:, :3]
    field[:, begin + 4 : begin + 8] = values[:, 3:]
