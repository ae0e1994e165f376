"""What the present CRTK convention says and obeys, verb for verb below an arm's namespace; see docs/crtk-topics.md.

[collaborative-robotics.github.io; what its Python client relies on]

Beside it what an arm of sawIntuitiveResearchKit 2.x has: settings, what it says on change, its actuators.
[jhu-dvrk/sawIntuitiveResearchKit 9e535e6: system_ROS.cpp for names and types, mtsIntuitiveResearchKitArm.cpp and
mtsIntuitiveResearchKitPSM.cpp for what they mean]

Services: joints are those of `measured_js`, in its order; poses are the tool's in the base. What cannot be answered
says so in `result` and `message`, and moves nothing. [crtk_msgs: QueryForwardKinematics, QueryInverseKinematics]
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from typing import Any, NamedTuple, cast

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_values import (
    joint_state_message,
    joint_values,
    operating_state_message,
    pose_message,
    pose_of,
    rotation_of,
)
from catenary.crtk.serving.dialect import (
    Dialect,
    MakeMessage,
    Obey,
    Publishers,
    Service,
    Vector3,
    jaw,
    joints_and_tool,
    single_number,
)
from catenary.crtk.serving.master_arm import MasterArm, impedance
from catenary.crtk.serving.served_arm import (
    BASE_FRAME,
    ServedArm,
    joint_move,
    pose_move,
    servo_pose,
    servo_pose_increment,
    servo_twist,
)
from catenary.crtk.serving.tool_pose import FrameOfForces, exerted, force_jacobian, torques_for
from catenary.crtk.topic_names import SIGNAL, STATISTICS, CrtkTopic, is_dvrks, topics
from catenary.errors import CatenaryError, InputError
from catenary.spatial import Pose, rotation_from_vector, rotation_vector

_TOOL_TYPE = "LARGE_NEEDLE_DRIVER:400006[..]"  # name:model[versions]; the tool of the catalogue's PSM
_ENDOSCOPE = "Classic_SD_STRAIGHT"  # whose tip the catalogue's ECM has
_CONVERT = "cisst_msgs/ConvertFloat64Array"
Set = Callable[[ServedArm, Message], None]
_Number, _Switch, _Text = (message_class(f"std_msgs/{name}") for name in ("Float64", "Bool", "String"))
_Wrench, _WrenchStamped = (message_class(f"geometry_msgs/{name}") for name in ("Wrench", "WrenchStamped"))
_Dimension, _Layout, _MultiArray = (
    message_class(f"std_msgs/{name}") for name in ("MultiArrayDimension", "MultiArrayLayout", "Float64MultiArray")
)


class Event(NamedTuple):
    """What is published when it changes."""

    value: Callable[[ServedArm], Any]  # None as long as there is nothing to say
    message: Callable[[Any, int], Message]  # of it, and of a stamp [ns]


def _current_state(arm: ServedArm) -> str:
    state = arm.state
    if state.state != "ENABLED" or not (state.is_homed or state.is_busy):
        return state.state
    return "HOMED" if state.is_homed else "HOMING"


def _desired_state(arm: ServedArm) -> str:
    """Return the state that it is in or on its way to, in the dVRK's words."""
    state = _current_state(arm)
    return "HOMED" if state == "HOMING" else state


def _ratio(arm: ServedArm) -> float:
    """Return the ratio of speed and acceleration; 0 where they differ, as the dVRK says it."""
    return arm.settings.speed_ratio if arm.settings.speed_ratio == arm.settings.acceleration_ratio else 0.0


_BUSY_EVERY_TICKS = 100  # ticks between two operating states of an arm that is busy
_STATES = ("current_state", "desired_state", "operating_state")  # verbs, in this order with each state command
_STATE = Event(
    lambda arm: (arm.state, arm.tick // _BUSY_EVERY_TICKS if arm.state.is_busy else 0),
    lambda state, stamp: operating_state_message(state[0], stamp),
)
_EVENTS = {  # a dVRK's
    "current_state": Event(_current_state, lambda state, _: _Text(state)),
    "desired_state": Event(_desired_state, lambda state, _: _Text(state)),
    "goal_reached": Event(
        lambda arm: arm.moves_ended if arm.moves_ended[0] else None, lambda ended, _: _Switch(ended[1])
    ),
    "period_statistics": Event(
        lambda arm: arm.statistics, lambda numbers, stamp: message_class(STATISTICS)(header(stamp), *numbers)
    ),
    "endoscope_type": Event(lambda _: _ENDOSCOPE, lambda tool, _: _Text(tool)),
    "gripper/closed": Event(lambda arm: _master(arm).is_closed, lambda closed, _: _Switch(closed)),
    "gripper/pinch": Event(lambda arm: _master(arm).pinches or None, lambda _, __: message_class(SIGNAL)()),
    "orientation_locked": Event(lambda arm: _master(arm).locked is not None, lambda locked, _: _Switch(locked)),
    "tool_type": Event(lambda _: _TOOL_TYPE, lambda tool, _: _Text(tool)),
    "trajectory_j/ratio": Event(_ratio, lambda ratio, _: _Number(ratio)),
    "trajectory_j/ratio_v": Event(lambda arm: arm.settings.speed_ratio, lambda ratio, _: _Number(ratio)),
    "trajectory_j/ratio_a": Event(lambda arm: arm.settings.acceleration_ratio, lambda ratio, _: _Number(ratio)),
}


def _set_ratio(arm: ServedArm, message: Message, which: tuple[str, ...]) -> None:
    """Scale what moves have of speed or acceleration, from the next move on."""
    ratio = float(message.data)
    if not 0.0 < ratio <= 1.0:
        raise InputError(f"ratio {ratio:g}: expected above 0 and at most 1")
    for name in which:
        setattr(arm.settings, name, ratio)


def _set_base_frame(arm: ServedArm, message: Message) -> None:
    """Place the arm's base: poses and steps of its tool are in that frame from now on; forces stay in its own axes."""
    arm.settings.base, arm.settings.base_name = pose_of(message), message.header.frame_id or BASE_FRAME


def _set_tool_type(_: ServedArm, message: Message, carried: str = _TOOL_TYPE) -> None:
    if message.data not in (carried, carried.partition("[")[0]):
        raise InputError(f'tool "{message.data}": the simulated arm carries a {carried} and no other')


def _emulate_tool_present(_: ServedArm, message: Message) -> None:
    if not message.data:
        raise InputError("the tool of the simulated arm cannot be taken off")


def _master(arm: ServedArm) -> MasterArm:
    """Return the operator's side of an MTM, the only arm with verbs that need it."""
    return cast(MasterArm, arm.master)


def _lock_orientation(arm: ServedArm, message: Message) -> None:
    """Hold an orientation, in the frame that clients chose, whenever torques or forces are commanded."""
    place = arm.settings.unplaced(Pose(rotation_of(message), np.zeros(3)))
    _master(arm).locked = place.rotation


def _switch(attribute: str) -> Set:
    return lambda arm, message: setattr(arm.settings, attribute, bool(message.data))


# what moves nothing
_SETTINGS: dict[str, Set] = {
    "use_gravity_compensation": _switch("compensates_gravity"),
    "body/set_cf_orientation_absolute": _switch("forces_in_base_axes"),
    "lock_orientation": _lock_orientation,
    "unlock_orientation": lambda arm, _: arm.unlock(),
    "hand/servo_cf": lambda arm, message: _master(arm).push(_wrench_of(arm, message), arm.measured.time),
    "hand/servo_jp": lambda arm, message: _master(arm).set_gripper(single_number(message)),
    "set_endoscope_type": partial(_set_tool_type, carried=_ENDOSCOPE),
    "trajectory_j/set_ratio": partial(_set_ratio, which=("speed_ratio", "acceleration_ratio")),
    "trajectory_j/set_ratio_v": partial(_set_ratio, which=("speed_ratio",)),
    "trajectory_j/set_ratio_a": partial(_set_ratio, which=("acceleration_ratio",)),
    "set_base_frame": _set_base_frame,
    "set_tool_type": _set_tool_type,
    "emulate_tool_present": _emulate_tool_present,
}


_FORWARD, _INVERSE = "crtk_msgs/QueryForwardKinematics", "crtk_msgs/QueryInverseKinematics"


def kinematics_services(place: str, arm: ServedArm) -> Iterator[Service]:
    """Yield the services of an arm, below its namespace `place`; `local/` in its own base, of one that has such."""

    def answered(kind: str, compute: Callable[[Message], dict[str, Any]]) -> tuple[str, Callable[[Message], Message]]:
        response = message_class(f"{kind}Response")

        def answer(request: Message) -> Message:
            try:
                return response(result=True, **compute(request))
            except CatenaryError as error:
                return response(result=False, message=str(error))

        return kind, answer

    def tool(request: Message) -> Pose:
        return arm.tool.pose(arm.whole(as_array("jp", request.jp, (len(arm.reported),))))

    forward = answered(_FORWARD, lambda request: {"cp": local_pose(arm.settings.placed(tool(request)), 0).pose})
    yield Service(f"{place}/forward_kinematics", *forward)
    if arm.dvrk:
        local = answered(_FORWARD, lambda request: {"cp": local_pose(tool(request), 0).pose})
        yield Service(f"{place}/local/forward_kinematics", *local)
    yield Service(f"{place}/inverse_kinematics", *answered(_INVERSE, lambda request: {"jp": _joints_at(arm, request)}))


def _joints_at(arm: ServedArm, request: Message) -> Floats:
    """Return joints at a pose, the nearest to those of the request; to the setpoint where it has none."""
    n = len(arm.reported)
    near = arm.setpoint.q if not len(request.jp) else arm.whole(as_array("jp", request.jp, (n,)))
    goal = Pose(rotation_of(request.cp.orientation), as_array("position", tuple(request.cp.position), (3,)))
    q = arm.tool.joints(arm.settings.unplaced(goal), near)
    arm.require_inside(q)
    return q[:n]


def actuator_service(place: str, joints: Floats) -> Service:
    """Return the service below a namespace that turns actuators' positions into joints', by (n, n), the jaw last."""

    def answer(request: Message) -> Message:
        actuators = as_array("input", request.input, (len(joints),))
        return message_class(f"{_CONVERT}Response")(output=joints @ actuators)

    return Service(f"{place}/actuator_to_joint_position", _CONVERT, answer)


# from the setpoint: a RAVEN-II's shoulder that covers 0.25 rad as fast as it may comes to a stop in FAULT
_SERVO_REACH = {"rad": 0.2, "m": 0.02}


def _frame_of(arm: ServedArm, frame: FrameOfForces) -> FrameOfForces:
    is_absolute = frame is FrameOfForces.BODY and arm.settings.forces_in_base_axes
    return FrameOfForces.TOOL_IN_BASE_AXES if is_absolute else frame


def measured_cf(arm: ServedArm, stamp: int, frame: FrameOfForces) -> Message:
    """Return the force [N] and moment [Nm] that the tool exerts, by the torques beyond the arm's own weight."""
    frame = _frame_of(arm, frame)
    x, y, z, a, b, c = exerted(arm.measured_tool, frame).tolist()
    where = "tool" if frame is FrameOfForces.BODY else BASE_FRAME
    return _WrenchStamped(header(stamp, where), _Wrench(Vector3(x, y, z), Vector3(a, b, c)))


def jacobian_matrix(arm: ServedArm, stamp: int, frame: FrameOfForces) -> Message:
    """Return the Jacobian (6, n) by rows: velocity over angular velocity, of the joints as `measured_js` has them."""
    matrix = force_jacobian(arm.measured_tool, frame)
    rows, columns = matrix.shape
    return _MultiArray(_layout(rows, columns), matrix.ravel())


@cache
def _layout(rows: int, columns: int) -> Message:
    return _Layout((_Dimension("rows", rows, rows * columns), _Dimension("columns", columns, columns)), 0)


def local_pose(pose: Pose, stamp: int) -> Message:
    """Return a pose in the arm's own base."""
    return pose_message(pose, stamp, BASE_FRAME)


# what is published of each arm in every tick, verb by verb
_PUBLISHED: dict[str, MakeMessage] = {
    **joints_and_tool(),
    "gripper/measured_js": lambda arm, stamp: joint_state_message(("gripper",), stamp, [_master(arm).gripper]),
    "jaw/measured_js": lambda arm, stamp: jaw(arm, arm.measured, stamp),
    "jaw/setpoint_js": lambda arm, stamp: jaw(arm, arm.setpoint, stamp),
    "measured_cs": lambda arm, stamp: _measured_cs(arm, stamp),
    "local/measured_cp": lambda arm, stamp: local_pose(arm.measured_tool.pose, stamp),
    "local/setpoint_cp": lambda arm, stamp: local_pose(arm.setpoint_tool.pose, stamp),
    **{f"{frame.value}measured_cf": partial(measured_cf, frame=frame) for frame in FrameOfForces},
    **{f"{frame.value}jacobian": partial(jacobian_matrix, frame=frame) for frame in FrameOfForces},
}


class CrtkDialect(Dialect):
    """Speaks for any arms, each in its namespace.

    An idle operating state is not repeated: CRTK's Python client takes whatever state comes after its move command for
    the answer to it. A state command is answered by the state before and after it, also where that is the same: clients
    wait for the answer. [jhu-dvrk: mtsIntuitiveResearchKitArm, SetDesiredState and StateEvents]
    """

    def __init__(self, arms: Mapping[str, ServedArm], listed: Iterable[CrtkTopic] | None = None) -> None:
        """Speak for arms over those topics that they have, of `listed`; a RAVEN-II's when None."""
        all_topics = topics("crtk") if listed is None else listed
        spoken = (one for one in all_topics if one.arm is None or (one.arm in arms and _has(arms[one.arm], one.verb)))
        super().__init__(arms, tuple(spoken), _PUBLISHED, _OBEYED)
        for topic in self.topics:
            if topic.verb == "measured_js" and topic.arm is not None:
                place, arm = topic.name.rpartition("/")[0], arms[topic.arm]
                self.services += tuple(kinematics_services(place, arm))
                if arm.joints_per_actuator is not None:
                    self.services += (actuator_service(place, arm.joints_per_actuator),)

    def begin(self, publishers: Publishers) -> None:
        """Prepare to publish by publishers; called once, before `publish`."""
        super().begin(publishers)
        self._events = [
            (arm, event, publishers[verb, name])
            for name, arm in self.arms.items()
            for verb, event in {**_EVENTS, "operating_state": _STATE}.items()
            if (verb, name) in publishers
        ]
        self._happened: list[Any] = [None] * len(self._events)

    def publish(self, now: int) -> None:
        """Publish the arms' states, stamped `now` [ns], where anybody listens."""
        for k, (arm, event, lazy) in enumerate(self._events):
            value = event.value(arm)
            if value != self._happened[k]:
                self._happened[k] = value
                lazy.publish(event.message(value, now))
        super().publish(now)

    def answer(self, arm: ServedArm, now: int) -> None:
        """Publish the states before a state command, stamped `now` [ns]; those after it follow."""
        for k, (whose, event, lazy) in enumerate(self._events):
            if whose is arm and lazy.topic.verb in _STATES:
                lazy.publish(event.message(event.value(arm), now))
                self._happened[k] = None

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Obey a command, as every dialect; what moves nothing is switched in any state."""
        setting = _SETTINGS.get(topic.verb)
        if topic.arm is None:
            return  # sounds of a dVRK's console
        if setting is not None:
            setting(self.arms[topic.arm], message)
        else:
            super().obey(topic, message)


def _has(arm: ServedArm, verb: str) -> bool:
    if is_dvrks(verb):
        return is_dvrks(verb, arm.dvrk) and arm.dvrk != ""
    if verb == "jaw/servo_jf":
        return arm.tool.has_jaws and "servo_jf_of" in arm.plant.supports
    return arm.tool.has_jaws or not verb.startswith("jaw/")


def _servo_cf(arm: ServedArm, message: Message, frame: FrameOfForces) -> None:
    """Exert a wrench, plus what holds the arm's weight where that was asked for."""
    frame = _frame_of(arm, frame)
    wrench = _wrench_of(arm, message, frame)
    arm.push_with(lambda: torques_for(arm.measured_tool, wrench, frame))


def _wrench_of(arm: ServedArm, message: Message, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Floats:
    """Return a client's wrench (6,) in the arm's own axes, where it is in base axes."""
    wrench = as_array("wrench", [*message.wrench.force, *message.wrench.torque], (6,))
    return arm.settings.unturned(wrench.reshape(2, 3)).ravel() if frame is FrameOfForces.TOOL_IN_BASE_AXES else wrench


def _servo_ci(arm: ServedArm, message: Message) -> None:
    """Push towards a goal by its gains, in the frame that clients chose; `body/servo_cf` is in base axes from now on.

    [mtsIntuitiveResearchKitArm::servo_ci]
    """

    def torques() -> Floats:
        tool, settings = arm.measured_tool, arm.settings
        wrench = impedance(message, settings.placed(tool.pose), settings.turned(tool.twist.reshape(2, 3)).ravel())
        return torques_for(tool, settings.unturned(wrench.reshape(2, 3)).ravel(), FrameOfForces.TOOL_IN_BASE_AXES)

    arm.settings.forces_in_base_axes = True
    arm.push_with(torques)


def _servo_jf(arm: ServedArm, message: Message) -> None:
    tau = _numbers(arm, message, "effort")
    arm.push_with(lambda: tau)


def _jaw_servo_jf(arm: ServedArm, message: Message) -> None:
    """Push the jaws' opening with a torque, the same on each; the arm holds."""
    tau = np.full(len(arm.names), np.nan)
    tau[-arm.tool.jaws :] = as_array("JointState.effort", message.effort, (1,))
    arm.push_with(lambda: tau)


def _numbers(arm: ServedArm, message: Message, field: str = "position", *, unnamed: Floats | None = None) -> Floats:
    """Return a command's numbers (n,); joints that it does not name, and a jaw apart, get those of `unnamed` (n,)."""
    count, names, n = len(getattr(message, field)), arm.reported, len(arm.reported)
    if not message.name and count != n:
        raise InputError(f"{count} numbers in `{field}`, expected {n}: {', '.join(names)}")
    values = joint_values(message, names, field, unnamed=None if unnamed is None else unnamed[:n])
    if n == len(arm.names):
        return values
    return np.concatenate([values, np.zeros(len(arm.names) - n) if unnamed is None else unnamed[n:]])


def _goal(arm: ServedArm, message: Message) -> Floats:
    """Return the joint positions (n,) that a command asks for; a jaw that joint states leave out stays."""
    return arm.whole(_numbers(arm, message)[: len(arm.reported)])


def _increments(arm: ServedArm, message: Message, field: str = "position") -> Floats:
    """Return a command's changes (n,); joints that are not named stay."""
    return _numbers(arm, message, field, unnamed=np.zeros(len(arm.names)))


def _servo_jp(arm: ServedArm, message: Message) -> None:
    """Go towards joint positions near the setpoint: a client that stood still for seconds makes no arm leap."""
    _require_near(arm, q := _goal(arm, message))
    arm.go_towards(q)


def _require_near(arm: ServedArm, q: Floats) -> None:
    for name, unit, way in zip(arm.reported, arm.plant.joint_units, q - arm.setpoint.q, strict=False):
        if abs(way) > _SERVO_REACH[unit]:
            raise InputError(
                f"{name} is {way:+.3g} {unit} from its setpoint, expected at most {_SERVO_REACH[unit]:g}; "
                "move_jp goes farther"
            )


def _moved(arm: ServedArm, message: Message) -> Pose:
    """Return the goal of a move_cr: turned and moved from the setpoint, in base axes."""
    start, (step, turn) = arm.tool.pose(arm.setpoint.q), _step_of(arm, message)
    return Pose(rotation_from_vector(turn) @ start.rotation, start.position + step)


def _step_of(arm: ServedArm, message: Message) -> Floats:
    """Return the step [m] and the turn, a rotation vector [rad], of a message, (2, 3) in the arm's own axes."""
    pose = pose_of(message)
    return arm.settings.unturned(np.array([pose.position, rotation_vector(pose.rotation)]))


_POSITION, _VELOCITY, _EFFORT = 1, 2, 4  # bits of a crtk_msgs/SetpointMode


def _servo_js(arm: ServedArm, message: Message) -> None:
    """Go to positions, with velocities the pace, or at velocities, or push, joint by joint as `mode` says.

    Without modes it is what the message has. Joints of no mode stay.
    """
    n, arrays = len(arm.reported), (message.position, message.velocity, message.effort)
    whole = sum(bit for bit, numbers in zip((_POSITION, _VELOCITY, _EFFORT), arrays, strict=True) if len(numbers))
    modes = np.array([mode.value for mode in message.mode] or [whole] * (len(message.name) or n))
    if len(modes) != (len(message.name) or n):
        raise InputError(f"servo_js: {len(modes)} modes, expected {len(message.name) or n}: one per joint")
    if (modes & _EFFORT > 0).any():
        if not (modes == _EFFORT).all() or len(modes) != n:
            raise InputError("servo_js: efforts with positions or velocities: the arm takes one kind, of all joints")
        _servo_jf(arm, message)
        return

    def numbers(field: str, bit: int, unnamed: Floats) -> Floats:
        chosen = modes & bit > 0
        if not chosen.any():
            return unnamed
        values = as_array(f"JointServo.{field}", getattr(message, field), (len(modes),))
        names = np.array(message.name or arm.reported)[chosen]
        named = message_class("sensor_msgs/JointState")(name=tuple(names.tolist()), position=values[chosen])
        return _numbers(arm, named, unnamed=unnamed)

    qd = numbers("velocity", _VELOCITY, np.zeros(len(arm.names)))
    if not (modes & _POSITION > 0).any():
        arm.run_at(qd)
        return
    if (modes == _VELOCITY).any():
        raise InputError("servo_js: some joints by velocity only, others by position: the arm takes one kind")
    _require_near(arm, q := arm.whole(numbers("position", _POSITION, arm.setpoint.q)[:n]))
    arm.go_towards(q, qd)


def _servo_cs(arm: ServedArm, message: Message) -> None:
    """Go to a pose, with a twist the pace; or at a twist, or push, by what is valid of a crtk_msgs/CartesianState."""
    has_pose, has_twist = message.pose_is_valid.data, message.twist_is_valid.data
    if message.wrench_is_valid.data:
        if has_pose or has_twist:
            raise InputError("servo_cs: a wrench with a pose or a twist: the arm takes one of them")
        _servo_cf(arm, message, FrameOfForces.TOOL_IN_BASE_AXES)
    elif has_pose:
        twist = arm.settings.unturned(np.array([message.twist.linear, message.twist.angular])).ravel()
        place = Pose(rotation_of(message.pose.orientation), as_array("pose", tuple(message.pose.position), (3,)))
        servo_pose(arm, arm.settings.unplaced(place), twist if has_twist else None)
    elif has_twist:
        _servo_cv(arm, message)


def _measured_cs(arm: ServedArm, stamp: int) -> Message:
    """Return pose, twist and wrench of the tool, all of one instant."""
    pose, twist, wrench = (_PUBLISHED[name](arm, stamp) for name in ("measured_cp", "measured_cv", "measured_cf"))
    valid = message_class("std_msgs/Bool")(True)
    return message_class("crtk_msgs/CartesianState")(
        pose.header, pose.pose, valid, twist.twist, valid, wrench.wrench, valid
    )


def _servo_cv(arm: ServedArm, message: Message) -> None:
    servo_twist(arm, arm.settings.unturned(np.array([message.twist.linear, message.twist.angular])).ravel())


_OBEYED: dict[str, Obey] = {
    "servo_jp": _servo_jp,
    "servo_jr": lambda arm, message: arm.increment(_increments(arm, message)),
    "servo_jv": lambda arm, message: arm.run_at(_increments(arm, message, "velocity")),
    "servo_jf": _servo_jf,
    "servo_cp": lambda arm, message: servo_pose(arm, arm.settings.unplaced(pose_of(message))),
    "servo_cr": lambda arm, message: servo_pose_increment(arm, *_step_of(arm, message)),
    "servo_cv": _servo_cv,
    "servo_js": _servo_js,
    "servo_cs": _servo_cs,
    "servo_ci": _servo_ci,
    **{f"{frame.value}servo_cf": partial(_servo_cf, frame=frame) for frame in FrameOfForces},
    "move_jp": lambda arm, message: arm.move(joint_move(arm, _goal(arm, message))),
    "move_jr": lambda arm, message: arm.move(joint_move(arm, arm.setpoint.q + _increments(arm, message))),
    "move_cp": lambda arm, message: arm.move(pose_move(arm, arm.settings.unplaced(pose_of(message)))),
    "move_cr": lambda arm, message: arm.move(pose_move(arm, _moved(arm, message))),
    "hold": lambda arm, message: arm.hold(),
    "free": lambda arm, message: arm.go_limp(),
    "jaw/servo_jp": lambda arm, message: arm.open_jaws(single_number(message)),
    "jaw/servo_jr": lambda arm, message: arm.increment(arm.jaw_increments(single_number(message))),
    "jaw/servo_jf": _jaw_servo_jf,
    "jaw/move_jp": lambda arm, message: arm.move_jaw(joint_move(arm, arm.joints_at_opening(single_number(message)))),
    "jaw/move_jr": lambda arm, message: arm.move_jaw(
        joint_move(arm, arm.setpoint.q + arm.jaw_increments(single_number(message)))
    ),
}
