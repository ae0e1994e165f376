"""What the public RAVEN-II software (branch crtk) says and obeys, topic for topic; see docs/crtk.md."""

from collections.abc import Callable
from functools import partial

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.conversions import joint_values, pose_of
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.names import RAVEN, CrtkTopic
from catenary.crtk.serving import arm_messages, cartesian_commands
from catenary.crtk.serving.outlet import Outlet
from catenary.crtk.serving.raven_state import RavenState
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.state_machine import why_not_obeyed
from catenary.errors import InputError
from catenary.recording.topics import Arm
from catenary.spatial import Pose, rotation_from_quaternion, rotation_vector

_JointState = message_class("sensor_msgs/JointState")
SLOW = round(SECOND / 33.0)  # [ns] between two messages on /joint_states: at most 33 Hz
_CHILD = "tool"
# rviz's model of the arms; each twice: as measured, and as set with a 2 behind
_RVIZ = ("shoulder", "elbow", "insertion", "tool_roll", "wrist_joint", "grasper_joint_1", "grasper_joint_2")
_RVIZ_NAMES = tuple(f"{name}_{side}{what}" for what in ("", "2") for side in "LR" for name in _RVIZ)
# the model's zeros: insertion from the remote centre, roll turned, second jaw the other way [r2_kinematics.h: d4]
_RVIZ_SIGN = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
_RVIZ_SHIFT = np.array([0.0, 0.0, -0.47, -np.pi / 4.0, 0.0, 0.0, 0.0])


# what is said of an arm in every tick, verb by verb
_SAID: dict[str, Callable[[ServedArm, int], Message]] = {
    "operating_state": arm_messages.operating_state,
    "measured_js": arm_messages.measured_js,
    "setpoint_js": arm_messages.setpoint_js,
    "grasp_measured_js": partial(arm_messages.jaw_measured_js, name="grasp"),
    "measured_cp": partial(arm_messages.measured_cp, child=_CHILD),
    "setpoint_cp": partial(arm_messages.setpoint_cp, child=_CHILD),
}


class RavenDialect:
    """Speaks for a robot of a gold and a green arm."""

    def __init__(self, arms: dict[Arm, ServedArm]) -> None:
        """Speak for arms of seven joints, both of them.

        Raises:
            InputError: An arm is missing or has other joints.
        """
        for name in ("gold", "green"):
            found = 0 if name not in arms else len(arms[name].names)
            if found != len(_RVIZ):
                raise InputError(
                    f"dialect raven: the {name} arm has {found} joints, expected {len(_RVIZ)}; other robots speak crtk"
                )
        self.topics = RAVEN
        self._arms = arms
        self._leader = next((arm for arm in arms.values() if arm.machine.can_change), arms["gold"])
        self._slow: int | None = None

    # what it says

    def begin(self, outlets: dict[tuple[str, Arm | None], Outlet]) -> None:
        """Prepare to publish."""
        self._said = [
            (outlets[verb, name], make, arm)
            for name, arm in self._arms.items()
            for verb, make in _SAID.items()
            if arm.tool is not None or not verb.endswith("_cp")
        ]
        self._said.append((outlets["operating_state", None], arm_messages.operating_state, self._leader))
        self._raven_state = RavenState(self._arms, self._leader.plant.period)
        self._whole, self._joint_states = outlets["ravenstate", None], outlets["joint_states", None]

    def publish(self, now: int) -> None:
        """Publish the arms' states, stamped `now` [ns], where anybody listens."""
        made = [(outlet, make(arm, now)) for outlet, make, arm in self._said if outlet.heard]
        for outlet, message in made:
            outlet.publish(message)
        if self._whole.heard:
            self._whole.publish(self._raven_state.message(now))
        if self._slow is None or not 0 <= now - self._slow < SLOW:
            self._slow = now
            if self._joint_states.heard:
                self._joint_states.publish(_JointState(header(now), _RVIZ_NAMES, self._rviz()))

    def _rviz(self) -> Floats:
        gold, green = self._arms["gold"], self._arms["green"]
        rows = (gold.measured.q, green.measured.q, gold.setpoint.q, green.setpoint.q)
        return np.concatenate([_RVIZ_SIGN * q + _RVIZ_SHIFT for q in rows])

    # what it obeys

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Obey a command of one of the topics `in`.

        Raises:
            InputError: It is none that can be obeyed; nothing moves.
            UnreachablePoseError: The mechanism refuses it.
        """
        if topic.verb == "raven_automove":
            self._automove(message)
            return
        arm = None if topic.arm is None else self._arms[topic.arm]
        if arm is None:
            raise InputError("the robot has no such arm")
        if not arm.machine.can_change:
            raise InputError("the arm is parked")
        if not arm.is_ready:
            raise InputError(why_not_obeyed(arm.state))
        _OBEY[topic.verb](arm, message)

    def _automove(self, message: Message) -> None:
        for i, arm in enumerate((self._arms["gold"], self._arms["green"])):
            step = np.asarray(message.del_pos[3 * i : 3 * i + 3], dtype=float)
            turn = message.tf_incr[i]
            step = 1e-6 * (step + as_array("raven_automove.tf_incr", tuple(turn.translation), (3,)))
            quaternion = np.array([turn.rotation.w, turn.rotation.x, turn.rotation.y, turn.rotation.z])
            if not np.isfinite(quaternion).all():
                raise InputError("raven_automove.tf_incr: expected a finite rotation")
            vector = (
                rotation_vector(rotation_from_quaternion(quaternion)) if quaternion.any() else np.zeros(3)
            )
            if not (step.any() or vector.any()) or not arm.is_ready or arm.tool is None:
                continue
            cartesian_commands.servo_pose_increment(
                arm, arm.tool.from_frame_0(step), arm.tool.from_frame_0(vector)
            )


def _numbers(arm: ServedArm, message: Message) -> tuple[Floats, bool]:
    """A command's numbers (7,), or the single one (1,) that means the grasp, and whether it is that."""
    if len(message.position) == 1 and len(message.name) <= 1:
        return as_array("JointState.position", message.position, (1,)), True
    return joint_values(message, arm.names), False


def _grasp(arm: ServedArm, opening: float) -> Floats:
    """Increments (7,) that open the jaws by an angle [rad], half with each."""
    dq = np.zeros(len(arm.names))
    dq[-arm_messages.JAWS :] = 0.5 * opening
    return dq


def _servo_jr(arm: ServedArm, message: Message) -> None:
    values, single = _numbers(arm, message)
    arm.increment(_grasp(arm, values[0]) if single else values)


def _servo_jp(arm: ServedArm, message: Message) -> None:
    values, single = _numbers(arm, message)
    if single:
        opening = values[0] - arm.setpoint.q[-arm_messages.JAWS :].sum()
        values = arm.setpoint.q + _grasp(arm, opening)
    elif len(message.position) != len(arm.names) and not message.name:
        raise InputError(
            f"servo_jp: {len(message.position)} numbers, expected {len(arm.names)}, or 1 for the grasp"
        )
    arm.step_towards(values)


def _servo_jv(arm: ServedArm, message: Message) -> None:
    field = "velocity" if len(message.velocity) else "position"  # the robot's own clients use the latter
    arm.increment(arm.plant.period * joint_values(message, arm.names, field))


def _grasp_jr(arm: ServedArm, message: Message) -> None:
    arm.increment(_grasp(arm, float(as_array("JointState.position", message.position, (1,))[0])))


def _grasp_jp(arm: ServedArm, message: Message) -> None:
    opening = float(as_array("JointState.position", message.position, (1,))[0])
    arm.step_towards(arm.setpoint.q + _grasp(arm, opening - arm.setpoint.q[-arm_messages.JAWS :].sum()))


def _servo_cp(arm: ServedArm, message: Message) -> None:
    cartesian_commands.servo_pose(arm, pose_of(message))


def _servo_cr(arm: ServedArm, message: Message) -> None:
    pose = _increment_of(message)
    cartesian_commands.servo_pose_increment(arm, pose.position, rotation_vector(pose.rotation))


def _servo_cv(arm: ServedArm, message: Message) -> None:
    pose, dt = _increment_of(message), arm.plant.period
    cartesian_commands.servo_pose_increment(arm, dt * pose.position, dt * rotation_vector(pose.rotation))


def _increment_of(message: Message) -> Pose:
    """Increment of a TransformStamped; a rotation that was never set, all zero, is none."""
    turn = message.transform.rotation
    if not any(turn):
        return Pose(np.eye(3), as_array("translation", tuple(message.transform.translation), (3,)))
    return pose_of(message)


_OBEY: dict[str, Callable[[ServedArm, Message], None]] = {
    "servo_jr": _servo_jr,
    "servo_jp": _servo_jp,
    "servo_jv": _servo_jv,
    "servo_cp": _servo_cp,
    "servo_cr": _servo_cr,
    "servo_cv": _servo_cv,
    "grasp_servo_jr": _grasp_jr,
    "grasp_servo_jp": _grasp_jp,
}
