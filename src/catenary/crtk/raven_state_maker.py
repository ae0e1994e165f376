"""`/ravenstate` from served arms: the robot's whole state in its own units, quickly enough for every millisecond."""

import numpy as np
from numpy.typing import NDArray

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
Tips = tuple[Floats, Floats]  # rotations (2, 3, 3), positions (2, 3) in frame 0: measured, then setpoint


class RavenStateMaker:
    """Makes the messages; seven-joint arms fill channels, anything else leaves them zero."""

    def __init__(self, arms: dict[Arm, ServedArm], period: float) -> None:
        self._arms = [(name, arm) for name, arm in arms.items() if len(arm.names) == _SEVEN]
        self._channels = {name: np.array(CHANNELS[name]) for name, _ in self._arms}
        self._period = round(1e9 * period)  # [ns]

    def message(self, head: Message, tips: dict[Arm, Tips]) -> Message:
        """Give the state as the arms last reported it.

        Args:
            head: Header.
            tips: Where the arms' tools are, as far as that is known.
        """
        jpos, jvel, jpos_d, mpos, mvel, mpos_d, tau = np.zeros((7, 16))
        counts, dac, offsets = np.zeros((3, 16), dtype=np.int32)
        pos, pos_d = np.zeros((2, 6), dtype=np.int32)
        ori, ori_d = np.zeros((2, 18), dtype=np.float32)
        grasp = np.zeros(2, dtype=np.float32)
        level, sublevel = 0, 0
        for name, arm in self._arms:
            channels, place = self._channels[name], _PLACE[name]
            jpos[channels] = arm.measured.q
            jvel[channels] = arm.measured.qd
            jpos_d[channels] = arm.setpoint.q
            grasp[place] = arm.setpoint.q[-2] + arm.setpoint.q[-1]
            if arm.machine.can_change:
                level = max(level, arm.machine.run_level(arm.state))
            if arm.plant.columns:
                own = arm.plant.telemetry()
                for into, column in (
                    (mpos, "mpos"),
                    (mvel, "mvel"),
                    (mpos_d, "mpos_d"),
                    (tau, "tau"),
                    (counts, "encVals"),
                    (dac, "dac_val"),
                    (offsets, "encoffsets"),
                ):
                    if column in own:
                        into[channels] = own[column]
            if name in tips:
                rotations, positions = tips[name]
                here, turn = slice(3 * place, 3 * place + 3), slice(9 * place, 9 * place + 9)
                # truncated to whole um, as the robot does
                pos[here], pos_d[here] = (_UM * positions).astype(np.int32)
                ori[turn], ori_d[turn] = rotations.reshape(2, 9)
        if level == 1:
            sublevel = _HOMING
        return _RavenState(
            hdr=head,
            runlevel=level,
            sublevel=sublevel,
            pos=pos,
            ori=ori,
            ori_d=ori_d,
            pos_d=pos_d,
            dt=self._period,
            encVals=counts,
            dac_val=dac,
            tau=_single(tau),
            mpos=_single(_DEGREES * mpos),
            jpos=_single(_DEGREES * jpos),
            mvel=_single(_DEGREES * mvel),
            jvel=_single(_DEGREES * jvel),
            mpos_d=_single(_DEGREES * mpos_d),
            jpos_d=_single(_DEGREES * jpos_d),
            grasp_d=grasp,
            encoffsets=_single(offsets),
        )


def _single(values: Floats | NDArray[np.int32]) -> NDArray[np.float32]:
    return values.astype(np.float32)
