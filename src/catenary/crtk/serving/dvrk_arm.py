"""What an arm of sawIntuitiveResearchKit 2.x has beside CRTK: settings, what it says on change, its actuators.

[jhu-dvrk/sawIntuitiveResearchKit 9e535e6: system_ROS.cpp for names and types, mtsIntuitiveResearchKitArm.cpp and
mtsIntuitiveResearchKitPSM.cpp for what they mean]
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, message_class
from catenary.crtk.message_values import pose_of
from catenary.crtk.serving.arm_messages import Service
from catenary.crtk.serving.served_arm import BASE, ServedArm
from catenary.errors import InputError

TOOL_TYPE = "LARGE_NEEDLE_DRIVER:400006[..]"  # name:model[versions]; the tool of the catalogue's PSM
CONVERT = "cisst_msgs/ConvertFloat64Array"
Set = Callable[[ServedArm, Message], None]
_Number, _Switch, _Text = (message_class(f"std_msgs/{name}") for name in ("Float64", "Bool", "String"))


class Event(NamedTuple):
    """What is published when it changes."""

    value: Callable[[ServedArm], Any]  # None as long as there is nothing to say
    message: Callable[[Any], Message]


def _desired_state(arm: ServedArm) -> str:
    """Return the state that it is in or on its way to, in the dVRK's words: an arm that homes is to be HOMED."""
    state = arm.state
    return "HOMED" if state.state == "ENABLED" and (state.is_homed or state.is_busy) else state.state


def _ratio(arm: ServedArm) -> float:
    """Return the ratio of speed and acceleration; 0 where they differ, as the dVRK says it."""
    return arm.speed_ratio if arm.speed_ratio == arm.acceleration_ratio else 0.0


EVENTS = {
    "desired_state": Event(_desired_state, _Text),
    "goal_reached": Event(lambda arm: arm.moves_ended if arm.moves_ended[0] else None, lambda ended: _Switch(ended[1])),
    "tool_type": Event(lambda _: TOOL_TYPE, _Text),
    "trajectory_j/ratio": Event(_ratio, _Number),
    "trajectory_j/ratio_v": Event(lambda arm: arm.speed_ratio, _Number),
    "trajectory_j/ratio_a": Event(lambda arm: arm.acceleration_ratio, _Number),
}


def _set_ratio(arm: ServedArm, message: Message, which: tuple[str, ...]) -> None:
    """Scale what moves have of speed or acceleration, from the next move on."""
    ratio = float(message.data)
    if not 0.0 < ratio <= 1.0:
        raise InputError(f"ratio {ratio:g}: expected above 0 and at most 1")
    for name in which:
        setattr(arm, name, ratio)


def _set_base_frame(arm: ServedArm, message: Message) -> None:
    """Place the arm's base: poses and steps of its tool are in that frame from now on; forces stay in its own axes."""
    arm.base, arm.base_name = pose_of(message), message.header.frame_id or BASE


def _set_tool_type(_: ServedArm, message: Message) -> None:
    if message.data not in (TOOL_TYPE, TOOL_TYPE.partition("[")[0]):
        raise InputError(f'tool "{message.data}": the simulated arm carries a {TOOL_TYPE} and no other')


def _emulate_tool_present(_: ServedArm, message: Message) -> None:
    if not message.data:
        raise InputError("the tool of the simulated arm cannot be taken off")


SETTINGS: dict[str, Set] = {
    "trajectory_j/set_ratio": partial(_set_ratio, which=("speed_ratio", "acceleration_ratio")),
    "trajectory_j/set_ratio_v": partial(_set_ratio, which=("speed_ratio",)),
    "trajectory_j/set_ratio_a": partial(_set_ratio, which=("acceleration_ratio",)),
    "set_base_frame": _set_base_frame,
    "set_tool_type": _set_tool_type,
    "emulate_tool_present": _emulate_tool_present,
}


def actuator_service(place: str, joints: Floats) -> Service:
    """Return the service below a namespace that turns actuators' positions into joints', by (n, n), the jaw last."""

    def answer(request: Message) -> Message:
        actuators = as_array("input", request.input, (len(joints),))
        return message_class(f"{CONVERT}Response")(output=joints @ actuators)

    return Service(f"{place}/actuator_to_joint_position", CONVERT, answer)
