"""What the present CRTK convention says and obeys, verb for verb below an arm's namespace; see docs/crtk.md.

[collaborative-robotics.github.io; what its Python client relies on]
"""

from collections.abc import Callable

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.conversions import joint_values, pose_of
from catenary.crtk.message import Message
from catenary.crtk.names import CrtkTopic, topics
from catenary.crtk.serving import arm_messages, cartesian_commands
from catenary.crtk.serving.moves import joint_move, straight_move
from catenary.crtk.serving.outlet import Outlet
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.serving.state_machine import why_not_obeyed
from catenary.errors import InputError
from catenary.plant import OperatingState
from catenary.recording.topics import Arm
from catenary.spatial import Pose, rotation_vector

NOT_MEASURED = ("measured_cf",)  # nothing measures forces at the tool
NOT_TAKEN = ("servo_cf",)
BUSY_EVERY = 100  # ticks between two operating states of an arm that is busy
# what is said in every tick, verb by verb
_SAID: dict[str, Callable[[ServedArm, int], Message]] = {
    "measured_js": arm_messages.measured_js,
    "setpoint_js": arm_messages.setpoint_js,
    "jaw/measured_js": arm_messages.jaw_measured_js,
    "jaw/setpoint_js": arm_messages.jaw_setpoint_js,
    "measured_cp": arm_messages.measured_cp,
    "setpoint_cp": arm_messages.setpoint_cp,
    "measured_cv": arm_messages.measured_cv,
}


class CrtkDialect:
    """Speaks for any arms, each in its namespace.

    The operating state is latched, and sent when it changes and ten times a second while it is busy; not otherwise:
    CRTK's Python client takes whatever state comes after its move command for the answer to it, so that an idle one,
    sent before the command arrived, would end its waiting.
    """

    def __init__(self, arms: dict[Arm, ServedArm]) -> None:
        """Speak for arms."""
        self._arms = arms
        self.topics = tuple(
            topic for topic in topics("crtk") if topic.arm in arms and _has(arms[topic.arm], topic.verb)
        )
        self._told: dict[Arm, tuple[OperatingState, int]] = {}

    # what it says

    def begin(self, outlets: dict[tuple[str, Arm | None], Outlet]) -> None:
        """Prepare to publish."""
        self._said = [
            (outlets[verb, name], make, arm)
            for name, arm in self._arms.items()
            for verb, make in _SAID.items()
            if (verb, name) in outlets
        ]
        self._states = [(name, arm, outlets["operating_state", name]) for name, arm in self._arms.items()]

    def publish(self, now: int) -> None:
        """Publish the arms' states, stamped `now` [ns], where anybody listens."""
        for name, arm, outlet in self._states:
            self._publish_state(name, arm, outlet, now)
        made = [(outlet, make(arm, now)) for outlet, make, arm in self._said if outlet.heard]
        for outlet, message in made:
            outlet.publish(message)

    def _publish_state(self, name: Arm, arm: ServedArm, outlet: Outlet, now: int) -> None:
        told, tick = self._told.get(name, (None, 0))
        if arm.state != told or (arm.state.is_busy and arm.tick - tick >= BUSY_EVERY):
            self._told[name] = arm.state, arm.tick
            outlet.publish(arm_messages.operating_state(arm, now))

    # what it obeys

    def obey(self, topic: CrtkTopic, message: Message) -> None:
        """Obey a command.

        Raises:
            InputError: It is none that can be obeyed; nothing moves.
            UnreachablePoseError: The mechanism refuses it.
        """
        assert topic.arm is not None
        arm = self._arms[topic.arm]
        if topic.verb == "use_gravity_compensation":
            if arm.gravity_torque is None:
                raise InputError("the arm's masses are not known")
            arm.compensates_gravity = bool(message.data)
        elif not arm.machine.can_change:
            raise InputError("the arm is parked")
        elif arm.is_ready:
            _OBEY[topic.verb](arm, message)
        else:
            raise InputError(why_not_obeyed(arm.state))


def _has(arm: ServedArm, verb: str) -> bool:
    """Return whether an arm has what a verb needs."""
    if verb in NOT_MEASURED or verb in NOT_TAKEN:
        return False
    if verb.startswith("jaw/"):
        return arm.tool is not None and arm.tool.has_jaws and verb != "jaw/servo_jf"
    if verb.endswith(("_cp", "_cr", "_cv")):
        return arm.tool is not None
    return True


def _numbers(arm: ServedArm, message: Message, field: str = "position") -> Floats:
    """A command's numbers (n,); names may leave joints out where nothing is asked of them."""
    given = len(getattr(message, field))
    if not message.name and given != len(arm.names):
        raise InputError(f"{given} numbers in `{field}`, expected {len(arm.names)}: {', '.join(arm.names)}")
    return joint_values(message, arm.names, field)


def _jaws(arm: ServedArm, opening: float) -> Floats:
    """Joints (n,) with the jaws opened to an angle [rad]."""
    q = arm.setpoint.q.copy()
    q[-arm_messages.JAWS :] += 0.5 * (opening - q[-arm_messages.JAWS :].sum())
    return q


def _angle(message: Message) -> float:
    return float(as_array("JointState.position", message.position, (1,))[0])


def _servo_jaws_by(arm: ServedArm, message: Message) -> None:
    dq = np.zeros(len(arm.names))
    dq[-arm_messages.JAWS :] = 0.5 * _angle(message)
    arm.increment(dq)


def _opening(arm: ServedArm) -> float:
    return float(arm.setpoint.q[-arm_messages.JAWS :].sum())


def _increment_goal(arm: ServedArm, message: Message) -> Pose:
    """Goal of a move_cr: turned and moved from the setpoint, in base axes."""
    assert arm.tool is not None
    start, step = arm.tool.pose(arm.setpoint.q), pose_of(message)
    return Pose(step.rotation @ start.rotation, start.position + step.position)


def _servo_cr(arm: ServedArm, message: Message) -> None:
    step = pose_of(message)
    cartesian_commands.servo_pose_increment(arm, step.position, rotation_vector(step.rotation))


def _servo_cv(arm: ServedArm, message: Message) -> None:
    twist = np.array([*message.twist.linear, *message.twist.angular])
    cartesian_commands.servo_twist(arm, twist)


_OBEY: dict[str, Callable[[ServedArm, Message], None]] = {
    "servo_jp": lambda arm, message: arm.go_towards(_numbers(arm, message)),
    "servo_jr": lambda arm, message: arm.increment(_numbers(arm, message)),
    "servo_jv": lambda arm, message: arm.run_at(_numbers(arm, message, "velocity")),
    "servo_jf": lambda arm, message: arm.push_with(_numbers(arm, message, "effort")),
    "servo_cp": lambda arm, message: cartesian_commands.servo_pose(arm, pose_of(message)),
    "servo_cr": _servo_cr,
    "servo_cv": _servo_cv,
    "move_jp": lambda arm, message: arm.move(joint_move(arm, _numbers(arm, message))),
    "move_jr": lambda arm, message: arm.move(joint_move(arm, arm.setpoint.q + _numbers(arm, message))),
    "move_cp": lambda arm, message: arm.move_when_planned(straight_move(arm, pose_of(message))),
    "move_cr": lambda arm, message: arm.move_when_planned(straight_move(arm, _increment_goal(arm, message))),
    "hold": lambda arm, message: arm.hold(),
    "free": lambda arm, message: arm.go_limp(),
    "jaw/servo_jp": lambda arm, message: arm.go_towards(_jaws(arm, _angle(message))),
    "jaw/servo_jr": _servo_jaws_by,
    "jaw/move_jp": lambda arm, message: arm.move(joint_move(arm, _jaws(arm, _angle(message)))),
    "jaw/move_jr": lambda arm, message: arm.move(
        joint_move(arm, _jaws(arm, _opening(arm) + _angle(message)))
    ),
}
