"""The public RAVEN-II software's dialect (branch crtk), topic for topic, /ravenstate too; see docs/crtk-topics.md."""

from collections.abc import Iterable, Mapping

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_values import joint_values, named_joints, operating_state_message, pose_of, rotation_of
from catenary.crtk.serving.dialect import Dialect, MakeMessage, Obey, Publishers, jaw, joints_and_tool, single_number
from catenary.crtk.serving.served_arm import ServedArm, servo_pose, servo_pose_increment
from catenary.crtk.serving.state_machine import robot_state
from catenary.crtk.topic_names import GRAV_DIR, RAVEN_TOPICS, CrtkTopic
from catenary.errors import InputError
from catenary.plant import OperatingState
from catenary.raven2.topics import CHANNELS, RAVENSTATE, STATE_COLUMNS
from catenary.recording.messages import NUMBERS, fields
from catenary.spatial import Pose, rotation_vector
from catenary.topics import SECOND

_PLACE: dict[str, int] = {"gold": 0, "green": 1}
_RavenState = message_class(RAVENSTATE.type)
_ARRAYS = {
    field.name: (field.length, np.dtype(NUMBERS[field.type])) for field in fields(RAVENSTATE.type) if field.length
}
_UM = 1.0 / STATE_COLUMNS["pos"].to_si  # truncated to whole ones, as the robot does
# fields of 16 channels; those below are columns of telemetry
_JOINTS = ("jpos", "jvel", "jpos_d")
_TELEMETRY = ("tau", "mpos", "mvel", "mpos_d", "encoffsets")
_COUNTS = ("encVals", "dac_val")


class RavenState:
    """Makes the message of arms of seven joints; what an arm does not know is zero, as the robot sends it."""

    def __init__(self, arms: Mapping[str, ServedArm], period: float) -> None:
        self._arms = arms
        self._channels = {name: np.array(CHANNELS[name]) for name in arms}
        self._moving = [arm for arm in arms.values() if arm.machine.can_change]
        self._nanoseconds = round(SECOND * period)
        self._arrays: dict[str, Floats] = {name: np.zeros(n, kind) for name, (n, kind) in _ARRAYS.items()}
        floats = (*_JOINTS, *_TELEMETRY)
        self._factors = np.array([1.0 / STATE_COLUMNS[name].to_si for name in floats])[:, np.newaxis]
        # rows of channels, which the message's arrays are
        self._floats = np.zeros((len(floats), 16), _ARRAYS["tau"][1])
        self._counts = np.zeros((len(_COUNTS), 16), _ARRAYS["encVals"][1])
        self._arrays |= dict(zip(floats, self._floats, strict=True)) | dict(zip(_COUNTS, self._counts, strict=True))
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
        return _RavenState(header(stamp), runlevel=level, sublevel=sublevel, dt=self._nanoseconds, **self._arrays)

    def _write(self, name: str, arm: ServedArm) -> None:
        arrays, place, channels = self._arrays, _PLACE[name], self._channels[name]
        measured, setpoint = arm.measured, arm.setpoint
        telemetry, unknown = arm.plant.telemetry(), np.zeros(len(channels))

        def rows(names: Iterable[str]) -> list[Floats]:
            values = (telemetry.get(name, unknown) for name in names)
            return [row if len(row) == len(channels) else unknown for row in values]

        joints = [measured.q, measured.qd, setpoint.q, *rows(_TELEMETRY)]
        self._floats[:, channels] = self._factors * joints
        self._counts[:, channels] = rows(_COUNTS)
        arrays["grasp_d"][place] = setpoint.q[-arm.tool.jaws :].sum()
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


_JointState = message_class("sensor_msgs/JointState")
_RVIZ_EVERY_NS = round(SECOND / 33.0)  # [ns] between two messages on /joint_states: at most 33 Hz
# rviz's model of the arms; each twice: as measured, and as set with a 2 behind
_RVIZ = ("shoulder", "elbow", "insertion", "tool_roll", "wrist_joint", "grasper_joint_1", "grasper_joint_2")
_RVIZ_NAMES = tuple(f"{name}_{side}{what}" for what in ("", "2") for side in "LR" for name in _RVIZ)
# the model's zeros: insertion from the remote centre, roll turned, second jaw the other way [r2_kinematics.h: d4]
_RVIZ_SIGN = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
_RVIZ_SHIFT = np.array([0.0, 0.0, -0.47, -np.pi / 4.0, 0.0, 0.0, 0.0])


def grasp_measured_js(arm: ServedArm, stamp: int) -> Message:
    """Return a RAVEN-II's grasp state: opening and both jaws, one velocity, one effort, its own names."""
    names = tuple(f"{arm.arm}_{name}" for name in ("grasp", "jaw1", "jaw2"))
    opening = jaw(arm, arm.measured, stamp, "grasp")
    positions = [opening.position[0], *arm.measured.q[-arm.tool.jaws :]]
    return _JointState(header(stamp), names, positions, opening.velocity, opening.effort)


# what is published of each arm in every tick, verb by verb
_PUBLISHED: dict[str, MakeMessage] = {**joints_and_tool(child="tool"), "grasp_measured_js": grasp_measured_js}


class RavenDialect(Dialect):
    """Speaks for a robot of a gold and a green arm, which have one operating state between them."""

    is_one_robot = True

    def __init__(self, arms: Mapping[str, ServedArm], _: object = None) -> None:
        """Speak for arms of seven joints, both of them; its topics are fixed."""
        for name in ("gold", "green"):
            count = 0 if name not in arms else len(arms[name].names)
            if count != len(_RVIZ):
                raise InputError(
                    f"dialect raven: the {name} arm has {count} joints, expected {len(_RVIZ)}; other robots speak crtk"
                )
        super().__init__(arms, RAVEN_TOPICS, _PUBLISHED, _OBEYED)
        self._leader = next((arm for arm in arms.values() if arm.machine.can_change), arms["gold"])
        self._slow: int | None = None

    def begin(self, publishers: Publishers) -> None:
        """Prepare to publish by publishers; called once, before `publish`."""
        super().begin(publishers)
        for name in (None, *self.arms):  # one robot, one state, whichever arm is asked
            lazy = publishers["operating_state", name]
            self._publishers.append((lazy, lambda _, stamp: operating_state_message(self.state, stamp), self._leader))
        self._raven_state = RavenState(self.arms, self._leader.plant.period)
        self._whole, self._joint_states = publishers["ravenstate", None], publishers["joint_states", None]

    def publish(self, now: int) -> None:
        """Publish the arms' states, stamped `now` [ns], where anybody listens."""
        super().publish(now)
        if self._whole.heard:
            self._whole.publish(self._raven_state.message(now))
        if self._slow is None or not 0 <= now - self._slow < _RVIZ_EVERY_NS:
            self._slow = now
            if self._joint_states.heard:
                gold, green = self.arms["gold"], self.arms["green"]
                rows = (gold.measured.q, green.measured.q, gold.setpoint.q, green.setpoint.q)
                joints = np.concatenate([_RVIZ_SIGN * q + _RVIZ_SHIFT for q in rows])
                self._joint_states.publish(_JointState(header(now), _RVIZ_NAMES, joints))

    @property
    def state(self) -> OperatingState:
        """Operating state of the whole robot."""
        return robot_state([arm.state for arm in self.arms.values() if arm.machine.can_change])

    def settle(self) -> str | None:
        """Stop all arms when one is in FAULT, as the robot's software e-stop does; say which, where it is news."""
        moving = [arm for arm in self.arms.values() if arm.machine.can_change]
        faulty = [arm for arm in moving if arm.state.state == "FAULT"]
        others = [arm for arm in moving if arm.state.state in ("ENABLED", "PAUSED")]
        if not faulty or not others:
            return None
        for arm in others:
            arm.hold()
            arm.machine.command("disable")
        return f"the {faulty[0].arm} arm is in FAULT, so all are stopped"

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Obey a command, as every dialect; `raven_automove` moves those arms that are ready."""
        if topic.verb == "raven_automove":
            self._automove(message)
        elif topic.verb == GRAV_DIR:  # of the arms' own compensation, in whole cm/s2 with z down; zeros are off
            for arm in (one for one in self.arms.values() if one.machine.can_change):
                switch = getattr(arm.plant, "switch_own_gravity", None)
                if switch is None:
                    raise InputError("the arm has no gravity compensation of its own")
                switch(tuple(message) if any(message) else None)
        else:
            super().obey(topic, message)

    def _automove(self, message: Message) -> None:
        for i, arm in enumerate((self.arms["gold"], self.arms["green"])):
            step = np.asarray(message.del_pos[3 * i : 3 * i + 3], dtype=float)
            turn = message.tf_incr[i]
            step = 1e-6 * (step + as_array("raven_automove.tf_incr", tuple(turn.translation), (3,)))
            vector = rotation_vector(rotation_of(turn.rotation)) if any(turn.rotation) else np.zeros(3)
            if not (step.any() or vector.any()) or not arm.is_ready:
                continue
            servo_pose_increment(arm, arm.tool.from_frame_0(step), arm.tool.from_frame_0(vector))


def _is_grasp(arm: ServedArm, message: Message) -> bool:
    """Return True if a command's single number is the grasp: it has no name, or none of a joint."""
    one = len(message.position) == 1 and len(message.name) <= 1
    return one and not named_joints(message, arm.names)


def _servo_jr(arm: ServedArm, message: Message) -> None:
    if _is_grasp(arm, message):
        arm.increment(arm.jaw_increments(single_number(message)))
    else:
        arm.increment(joint_values(message, arm.names, unnamed=np.zeros(len(arm.names))))


def _servo_jp(arm: ServedArm, message: Message) -> None:
    if _is_grasp(arm, message):
        arm.step_towards(arm.joints_at_opening(single_number(message)))
        return
    if len(message.position) != len(arm.names) and not message.name:
        raise InputError(f"servo_jp: {len(message.position)} numbers, expected {len(arm.names)}, or 1 for the grasp")
    arm.step_towards(joint_values(message, arm.names, unnamed=arm.setpoint.q))


def _servo_jv(arm: ServedArm, message: Message) -> None:
    field = "velocity" if len(message.velocity) else "position"  # the robot's own clients use the latter
    arm.increment(arm.plant.period * joint_values(message, arm.names, field, unnamed=np.zeros(len(arm.names))))


def _grasp_servo_jv(arm: ServedArm, message: Message) -> None:
    """Open the jaws for a millisecond, at a velocity [rad/s] of their opening."""
    values = message.velocity if len(message.velocity) else message.position
    velocity = float(as_array("JointState.velocity", values[:1], (1,))[0])
    arm.increment(arm.jaw_increments(arm.plant.period * velocity))


def _servo_cr(arm: ServedArm, message: Message, share: float = 1.0) -> None:
    pose = _increment_of(message)
    servo_pose_increment(arm, share * pose.position, share * rotation_vector(pose.rotation))


def _increment_of(message: Message) -> Pose:
    """Increment of a TransformStamped; a rotation that was never set, all zero, is none."""
    turn = message.transform.rotation
    if not any(turn):
        return Pose(np.eye(3), as_array("translation", tuple(message.transform.translation), (3,)))
    return pose_of(message)


_OBEYED: dict[str, Obey] = {
    "servo_jr": _servo_jr,
    "servo_jp": _servo_jp,
    "servo_jv": _servo_jv,
    "servo_cp": lambda arm, message: servo_pose(arm, pose_of(message)),
    "servo_cr": _servo_cr,
    "servo_cv": lambda arm, message: _servo_cr(arm, message, arm.plant.period),
    "grasp_servo_jr": lambda arm, message: arm.increment(arm.jaw_increments(single_number(message))),
    "grasp_servo_jv": _grasp_servo_jv,
    "grasp_servo_jp": lambda arm, message: arm.step_towards(arm.joints_at_opening(single_number(message))),
}
