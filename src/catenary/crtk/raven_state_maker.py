"""`/ravenstate` from served arms: the robot's whole state in its own units, quickly enough for every millisecond."""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.arm_frames import JAWS, MEASURED, SETPOINT, ArmFrames
from catenary.crtk.frames import Frame, NumberFields, Numbers, frame_of
from catenary.crtk.message import header, message_class
from catenary.crtk.served_arm import ServedArm
from catenary.crtk.tool_numbers import POSITIONS_0, ROTATIONS_0
from catenary.plant import OperatingState
from catenary.recording.topics import Arm

_DEGREES = 180.0 / np.pi  # every position and velocity is multiplied by it, metres too
_UM = 1e6  # truncated to whole ones, as the robot does
_PLACE: dict[Arm, int] = {"gold": 0, "green": 1}
_TYPE = "raven_2/raven_state"
_HOMING = 3  # sublevel in run level init
# fields of the message that are columns of telemetry, with what a number in SI is multiplied by
OWN = {
    "tau": 1.0, "mpos": _DEGREES, "mvel": _DEGREES, "mpos_d": _DEGREES, "encVals": 1.0, "dac_val": 1.0,
    "encoffsets": 1.0,
}  # fmt: skip
LEVELS = 2  # numbers: run level and sublevel


def raven_state_frame(arms: Mapping[Arm, ArmFrames], levels: int, period: float) -> Frame:
    """Give the frame of the messages of arms of seven joints.

    Args:
        arms: What is written of each, the columns of `OWN` among it.
        levels: Where run level and sublevel are among the numbers.
        period: [s] of a tick.
    """
    message = message_class(_TYPE)(header(0), dt=round(1e9 * period))
    fields = NumberFields(_TYPE, message)
    parts = [fields.numbers("runlevel", levels), fields.numbers("sublevel", levels + 1)]
    for name, arm in arms.items():
        parts += _arm(fields, _PLACE[name], arm)
    return Frame(bytes(frame_of(_TYPE, message)), tuple(parts))


def _arm(fields: NumberFields, place: int, arm: ArmFrames) -> list[Numbers]:
    positions, velocities = MEASURED, MEASURED + 1
    rows = {
        "jpos": (arm.row(positions), _DEGREES),
        "jvel": (arm.row(velocities), _DEGREES),
        "jpos_d": (arm.row(SETPOINT), _DEGREES),
    }
    rows |= {name: (arm.columns[name], factor) for name, factor in OWN.items()}
    jaw = arm.row(SETPOINT) + arm.n - JAWS
    parts = [fields.numbers("grasp_d", jaw, first=place)._replace(plus=jaw + 1)]
    for name, (source, factor) in rows.items():
        # an arm has eight channels; the fourth is unused
        parts.append(fields.numbers(name, source, 3, first=8 * place, factor=factor))
        parts.append(fields.numbers(name, source + 3, 4, first=8 * place + 4, factor=factor))
    if arm.arm.tool is not None:
        for name, at in zip(("pos", "pos_d"), POSITIONS_0, strict=True):
            parts.append(fields.numbers(name, arm.tool + at, 3, first=3 * place, factor=_UM))
        for name, at in zip(("ori", "ori_d"), ROTATIONS_0, strict=True):
            parts.append(fields.numbers(name, arm.tool + at, 9, first=9 * place))
    return parts


class RavenLevels:
    """Run level and sublevel of a robot: those of the arm that is furthest."""

    def __init__(self, arms: Mapping[Arm, ServedArm], out: Floats) -> None:
        """Keep them among the numbers that are written, (2,)."""
        self._arms = [arm for arm in arms.values() if arm.machine.can_change]
        self._out = out
        self._told: list[OperatingState] = []

    def write(self) -> None:
        """Write them, if a state has changed."""
        states = [arm.state for arm in self._arms]
        if states != self._told:
            self._told = states
            level = max((arm.machine.run_level(arm.state) for arm in self._arms), default=0)
            self._out[:] = level, _HOMING if level == 1 else 0
