"""`/ravenstate` from served arms: the robot's whole state in its own units, as its software publishes it."""

from collections.abc import Iterable, Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.raven_conversions import CHANNELS
from catenary.crtk.serving.served_arm import JAWS, ServedArm
from catenary.crtk.serving.state_machine import robot_state
from catenary.recording.messages import NUMBERS, fields

_DEGREES = 180.0 / np.pi  # every position and velocity is multiplied by it, metres too
_UM = 1e6  # truncated to whole ones, as the robot does
_PLACE: dict[str, int] = {"gold": 0, "green": 1}
_RavenState = message_class("raven_2/raven_state")
_ARRAYS = {
    field.name: (field.length, np.dtype(NUMBERS[field.type]))
    for field in fields("raven_2/raven_state")
    if field.length
}
# fields of 16 channels, with what a number in SI is multiplied by; those below are columns of telemetry
_JOINTS = {"jpos": _DEGREES, "jvel": _DEGREES, "jpos_d": _DEGREES}
_TELEMETRY = {"tau": 1.0, "mpos": _DEGREES, "mvel": _DEGREES, "mpos_d": _DEGREES, "encoffsets": 1.0}
_COUNTS = ("encVals", "dac_val")


class RavenState:
    """Makes the message of arms of seven joints; what an arm does not know is zero, as the robot sends it."""

    def __init__(self, arms: Mapping[str, ServedArm], period: float) -> None:
        """Prepare; `period` [s] of a tick."""
        self._arms = arms
        self._channels = {name: np.array(CHANNELS[name]) for name in arms}
        self._moving = [arm for arm in arms.values() if arm.machine.can_change]
        self._nanoseconds = round(SECOND * period)
        self._arrays: dict[str, Floats] = {name: np.zeros(n, kind) for name, (n, kind) in _ARRAYS.items()}
        factors = _JOINTS | _TELEMETRY
        self._factors = np.array([*factors.values()])[:, np.newaxis]
        # rows of channels, which the message's arrays are
        self._floats = np.zeros((len(factors), 16), _ARRAYS["tau"][1])
        self._counts = np.zeros((len(_COUNTS), 16), _ARRAYS["encVals"][1])
        self._arrays |= dict(zip(factors, self._floats, strict=True)) | dict(
            zip(_COUNTS, self._counts, strict=True)
        )
        self._written: dict[str, int] = {}  # change of an arm that the arrays show

    def message(self, stamp: int) -> Message:
        """Return the message at `stamp` [ns]; the next one reuses its arrays."""
        for name, arm in self._arms.items():
            if self._written.get(name) != arm.changes:
                self._written[name] = arm.changes
                self._write(name, arm)
        # the arm that is furthest
        level = max((arm.machine.run_level(arm.state) for arm in self._moving), default=0)
        # branch crtk puts there whether all joints are homed [local_io.cpp: publish_ravenstate_ros, robot_ready]
        sublevel = int(robot_state([arm.state for arm in self._moving]).is_homed)
        return _RavenState(
            header(stamp), runlevel=level, sublevel=sublevel, dt=self._nanoseconds, **self._arrays
        )

    def _write(self, name: str, arm: ServedArm) -> None:
        arrays, place, channels = self._arrays, _PLACE[name], self._channels[name]
        measured, setpoint = arm.measured, arm.setpoint
        telemetry, unknown = arm.plant.telemetry(), np.zeros(len(channels))

        def rows(names: Iterable[str]) -> list[Floats]:
            found = (telemetry.get(name, unknown) for name in names)
            return [row if len(row) == len(channels) else unknown for row in found]

        joints = [measured.q, measured.qd, setpoint.q, *rows(_TELEMETRY)]
        self._floats[:, channels] = self._factors * joints
        self._counts[:, channels] = rows(_COUNTS)
        arrays["grasp_d"][place] = setpoint.q[-JAWS:].sum()
        # velocity and angular velocity of the tool in its own axes; the robot, too, sends them twice
        twist = (arm.measured_tool.twist.reshape(2, 3) @ arm.measured_tool.pose.rotation).ravel()
        for twice in ("jac_vel", "jac_f"):
            arrays[twice][6 * place : 6 * place + 6] = twist
        for pose, position, rotation in (
            (arm.measured_tool.pose, "pos", "ori"),
            (arm.setpoint_tool.pose, "pos_d", "ori_d"),
        ):
            in_frame_0 = arm.tool.in_frame_0(pose)
            arrays[position][3 * place : 3 * place + 3] = _UM * in_frame_0.position
            arrays[rotation][9 * place : 9 * place + 9] = in_frame_0.rotation.ravel()
