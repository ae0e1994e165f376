"""`/ravenstate` from served arms: the robot's whole state in its own units, quickly enough for every millisecond."""

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.message import Message, message_class
from catenary.crtk.raven_conversions import CHANNELS
from catenary.crtk.served_arm import ServedArm
from catenary.recording.topics import Arm

_DEGREES = 180.0 / np.pi  # every position and velocity is multiplied by it, metres too
_UM = 1e6
_PLACE: dict[Arm, int] = {"gold": 0, "green": 1}
_RavenState = message_class("raven_2/raven_state")
_HOMING = 3  # sublevel in run level init
_SEVEN = 7
# rows of the table in which a message is put together, with what a number is multiplied by
_ROWS = {
    "jpos": _DEGREES, "jvel": _DEGREES, "jpos_d": _DEGREES, "mpos": _DEGREES, "mvel": _DEGREES, "mpos_d": _DEGREES,
    "tau": 1.0, "encoffsets": 1.0,
}  # fmt: skip
_FROM_TELEMETRY = ("mpos", "mvel", "mpos_d", "tau", "encoffsets")
_WHOLE = ("encVals", "dac_val")
_SCALE = np.array(list(_ROWS.values()))[:, np.newaxis]
_PLACES = {name: k for k, name in enumerate(_ROWS)}
Tips = tuple[Floats, Floats]  # rotations (2, 3, 3), positions (2, 3) in frame 0: measured, then setpoint


class RavenStateMaker:
    """Makes the messages; seven-joint arms fill channels, anything else leaves them zero."""

    def __init__(self, arms: dict[Arm, ServedArm], period: float) -> None:
        self._arms = [(name, arm) for name, arm in arms.items() if len(arm.names) == _SEVEN]
        self._channels = {name: np.array(CHANNELS[name]) for name, _ in self._arms}
        self._period = round(1e9 * period)  # [ns]
        self._table = np.zeros((len(_ROWS), 16))
        self._whole = np.zeros((len(_WHOLE), 16), dtype=np.int32)
        self._grasp = np.zeros(2, dtype=np.float32)
        self._pos = np.zeros((2, 6), dtype=np.int32)  # measured, set
        self._ori = np.zeros((2, 18), dtype=np.float32)
        for name, arm in self._arms:
            self._fill(name, arm)

    def message(self, head: Message, tips: dict[Arm, Tips]) -> Message:
        """Give the state as the arms last reported it.

        Args:
            head: Header.
            tips: Where the arms' tools are, as far as that is known.
        """
        level = 0
        for name, arm in self._arms:
            if arm.machine.can_change:  # a parked arm's numbers stay
                self._fill(name, arm)
                level = max(level, arm.machine.run_level(arm.state))
            if name in tips:
                self._place_tool(_PLACE[name], *tips[name])
        # the message's own, since messages are kept
        rows = dict(zip(_ROWS, (_SCALE * self._table).astype(np.float32), strict=True))
        counts, dac = self._whole.copy()
        (pos, pos_d), (ori, ori_d) = self._pos.copy(), self._ori.copy()
        return _RavenState(
            hdr=head,
            runlevel=level,
            sublevel=_HOMING if level == 1 else 0,
            dt=self._period,
            pos=pos,
            pos_d=pos_d,
            ori=ori,
            ori_d=ori_d,
            encVals=counts,
            dac_val=dac,
            grasp_d=self._grasp.copy(),
            **rows,
        )

    def _fill(self, name: Arm, arm: ServedArm) -> None:
        channels, table = self._channels[name], self._table
        table[0, channels] = arm.measured.q
        table[1, channels] = arm.measured.qd
        table[2, channels] = arm.setpoint.q
        self._grasp[_PLACE[name]] = arm.setpoint.q[-2] + arm.setpoint.q[-1]
        if not arm.plant.columns:
            return
        own = arm.plant.telemetry()
        for column in _FROM_TELEMETRY:
            if column in own:
                table[_PLACES[column], channels] = own[column]
        for k, column in enumerate(_WHOLE):
            if column in own:
                self._whole[k, channels] = own[column]

    def _place_tool(self, place: int, rotations: Floats, positions: Floats) -> None:
        self._pos[:, 3 * place : 3 * place + 3] = _UM * positions  # truncated to whole um, as the robot does
        self._ori[:, 9 * place : 9 * place + 9] = rotations.reshape(2, 9)
