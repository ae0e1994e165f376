"""Topics of both dialects in which robots speak CRTK: which, of what type, and who sends.

`raven` is what the public RAVEN-II software speaks (uw-biorobotics/raven2, branch crtk); `crtk` is the present
convention (collaborative-robotics.github.io, PoseStamped since 2022). The two differ in types, so one topic cannot
serve both. Rates and units are in docs/crtk-topics.md.

Trap: the RAVEN-II publishes `measured_js` and `measured_cp` of its arms swapped, arm1 the green arm's and arm2 the gold
one's; setpoints and commands are not swapped. Ask `topic_name` for an arm, never put a name together.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from catenary.crtk.dialects import dialect_named
from catenary.errors import InputError
from catenary.raven2.topics import MEASURED_JS, Arm

Direction = Literal["out", "in"]  # from the robot, to the robot
JOINT_STATE = "sensor_msgs/JointState"
TRANSFORM = "geometry_msgs/TransformStamped"
_POSE = "geometry_msgs/PoseStamped"
_TWIST = "geometry_msgs/TwistStamped"
_WRENCH = "geometry_msgs/WrenchStamped"
_VECTOR = "geometry_msgs/Vector3"
_MATRIX = "std_msgs/Float64MultiArray"
_NUMBER, _SWITCH, TEXT, SIGNAL = "std_msgs/Float64", "std_msgs/Bool", "std_msgs/String", "std_msgs/Empty"
COMMAND = "crtk_msgs/StringStamped"
WARNING = "warning"  # verb: what an arm has to say of commands that it did not obey; ours, in both dialects
ERROR = "error"  # verb: what stopped an arm of a dVRK
STATISTICS = "cisst_msgs/IntervalStatistics"
_CARTESIAN = "crtk_msgs/CartesianState"
DIAGNOSTICS = "/diagnostics"  # topic of all robots: their states, and why they are in FAULT
DIAGNOSTICS_TYPE = "diagnostic_msgs/DiagnosticArray"
# verb: gravity that a RAVEN-II's own compensation goes by, ours: the robot's software takes it from nobody
GRAV_DIR = "grav_dir"
BUTTON = "/silver_button"  # service, and topic: the RAVEN-II's start button, which no public topic presses
BUTTON_TYPE = "std_srvs/Trigger"
NAMESPACES: dict[Arm, str] = {"gold": "/arm1", "green": "/arm2"}  # of a RAVEN-II


@dataclass(frozen=True)
class CrtkTopic:
    """A topic of a robot."""

    name: str
    type: str  # as it is declared: the RAVEN-II still uses a name that crtk_msgs has dropped
    direction: Direction
    verb: str  # last word of the name
    arm: str | None = None  # whose, gold or green or a name of its own; None: the robot's

    @property
    def commands_state(self) -> bool:
        """Whether it changes operating states."""
        return self.type == COMMAND or self.verb in CONSOLE_COMMANDS

    @property
    def moves(self) -> bool:
        """Whether it moves an arm: neither a state command nor a setting."""
        return self.direction == "in" and not (self.commands_state or self.verb in _SETTINGS or self.verb in _SOUNDS)

    @property
    def is_latched(self) -> bool:
        """Whether the topic is latched: late subscribers get its last message."""
        is_event = is_dvrks(self.verb) and self.direction == "out" and self.type in _TOLD_ON_CHANGE
        return self.verb == "operating_state" or (is_event and self.verb != ERROR)


_Verbs = dict[str, tuple[str, Direction]]  # verb: type, direction
_RAVEN_ROBOT: _Verbs = {
    "ravenstate": ("raven_2/raven_state", "out"),
    "operating_state": ("crtk_msgs/operating_state", "out"),
    "joint_states": (JOINT_STATE, "out"),
    "state_command": (COMMAND, "in"),
    "raven_automove": ("raven_2/raven_automove", "in"),
    GRAV_DIR: (_VECTOR, "in"),
    BUTTON[1:]: (SIGNAL, "in"),
}
_SWAPPED: _Verbs = {
    "measured_js": (JOINT_STATE, "out"),
    "measured_cp": (TRANSFORM, "out"),
    "measured_cv": (_TWIST, "out"),
}
_RAVEN_ARM: _Verbs = {
    "operating_state": ("crtk_msgs/operating_state", "out"),
    "setpoint_js": (JOINT_STATE, "out"),
    "setpoint_cp": (TRANSFORM, "out"),
    "setpoint_cv": (_TWIST, "out"),
    WARNING: (TEXT, "out"),
    "state_command": (COMMAND, "in"),
    **dict.fromkeys(("servo_jr", "servo_jp", "servo_jv"), (JOINT_STATE, "in")),
    **dict.fromkeys(("servo_cp", "servo_cr", "servo_cv"), (TRANSFORM, "in")),
}
_GRASP: _Verbs = {
    "measured_js": (JOINT_STATE, "out"),
    "servo_jr": (JOINT_STATE, "in"),
    "servo_jp": (JOINT_STATE, "in"),
    "servo_jv": (JOINT_STATE, "in"),
}
_CRTK: _Verbs = {
    "operating_state": ("crtk_msgs/OperatingState", "out"),
    **dict.fromkeys(("measured_js", "setpoint_js"), (JOINT_STATE, "out")),
    **dict.fromkeys(("measured_cp", "setpoint_cp"), (_POSE, "out")),
    **dict.fromkeys(("measured_cv", "setpoint_cv"), (_TWIST, "out")),
    **dict.fromkeys(("measured_cf", "body/measured_cf", "spatial/measured_cf"), (_WRENCH, "out")),
    **dict.fromkeys(("jacobian", "body/jacobian", "spatial/jacobian"), (_MATRIX, "out")),
    WARNING: (TEXT, "out"),
    "state_command": (COMMAND, "in"),
    **dict.fromkeys(("servo_jp", "servo_jr", "servo_jv", "servo_jf", "move_jp", "move_jr"), (JOINT_STATE, "in")),
    **dict.fromkeys(("servo_cp", "servo_cr", "move_cp", "move_cr"), (_POSE, "in")),
    "servo_cv": (_TWIST, "in"),
    **dict.fromkeys(("servo_cf", "body/servo_cf", "spatial/servo_cf"), (_WRENCH, "in")),
    "body/set_cf_orientation_absolute": (_SWITCH, "in"),
    **dict.fromkeys(("hold", "free"), (SIGNAL, "in")),
    "use_gravity_compensation": (_SWITCH, "in"),
}
_RATIOS = ("ratio", "ratio_v", "ratio_a")
# verbs of a gripper, below `jaw/`
_JAW = ("measured_js", "setpoint_js", "servo_jp", "servo_jr", "servo_jf", "move_jp", "move_jr")
# what an arm of sawIntuitiveResearchKit 2.x has besides [jhu-dvrk, ros/dvrk_robot/src/system_ROS.cpp]; out: on change
_DVRK: _Verbs = {
    **dict.fromkeys(("current_state", "desired_state", ERROR), (TEXT, "out")),
    "period_statistics": (STATISTICS, "out"),
    "measured_cs": (_CARTESIAN, "out"),
    "servo_cs": (_CARTESIAN, "in"),
    "servo_js": ("crtk_msgs/JointServo", "in"),
    "servo_ci": ("crtk_msgs/CartesianImpedance", "in"),
    "goal_reached": (_SWITCH, "out"),
    **{f"trajectory_j/{ratio}": (_NUMBER, "out") for ratio in _RATIOS},
    **{f"trajectory_j/set_{ratio}": (_NUMBER, "in") for ratio in _RATIOS},
    "set_base_frame": (_POSE, "in"),
    # poses in its own base, where setup joints carry it on a cart
    **{f"local/{verb}": (_POSE, "out") for verb in ("measured_cp", "setpoint_cp")},
}
_ANY_JAW: _Verbs = {f"jaw/{verb}": _CRTK[verb] for verb in _JAW}
# what one kind of a dVRK's arms has; `hand/` is ours: what an operator's hand does to a simulated MTM
DVRK_ARMS: dict[str, _Verbs] = {
    "PSM": {"tool_type": (TEXT, "out"), "set_tool_type": (TEXT, "in"), "emulate_tool_present": (_SWITCH, "in")},
    "MTM": {
        "gripper/measured_js": (JOINT_STATE, "out"),
        "gripper/closed": (_SWITCH, "out"),
        "gripper/pinch": (SIGNAL, "out"),
        "orientation_locked": (_SWITCH, "out"),
        "lock_orientation": ("geometry_msgs/Quaternion", "in"),
        "unlock_orientation": (SIGNAL, "in"),
        "hand/servo_cf": (_WRENCH, "in"),
        "hand/servo_jp": (JOINT_STATE, "in"),
    },
    "ECM": {"endoscope_type": (TEXT, "out"), "set_endoscope_type": (TEXT, "in")},
}
_ALL_DVRKS: _Verbs = _DVRK | {verb: kind for verbs in DVRK_ARMS.values() for verb, kind in verbs.items()}
_TOLD_ON_CHANGE = (TEXT, _SWITCH, _NUMBER, STATISTICS)  # types
_SETTINGS = frozenset(
    {GRAV_DIR, BUTTON[1:], "body/set_cf_orientation_absolute", "use_gravity_compensation"}
    | {verb for verb, (_, way) in _ALL_DVRKS.items() if way == "in" and not verb.startswith("servo")}
)


def is_dvrks(verb: str, kind: str | None = None) -> bool:
    """Return True if a verb is one that a dVRK's arms have besides CRTK's."""
    return verb in _ALL_DVRKS if kind is None else verb in _DVRK or verb in DVRK_ARMS.get(kind, {})


# verbs of a dVRK's console, which is called system since 2.4, and the state commands that they stand for
CONSOLE_COMMANDS = {
    "console/power_on": ("enable",),
    "console/power_off": ("disable",),
    "console/home": ("enable", "home"),
}
# what its classes wait for besides; a simulated console makes no sound
_SOUNDS = {"console/set_volume": _NUMBER, "console/beep": _MATRIX, "console/string_to_speech": TEXT}


def _below(place: str, verbs: _Verbs, arm: str | None = None, prefix: str = "") -> Iterator[CrtkTopic]:
    for verb, (kind, direction) in verbs.items():
        yield CrtkTopic(f"{place}/{verb}", kind, direction, prefix + verb, arm)


def _raven() -> Iterator[CrtkTopic]:
    yield from _below("", _RAVEN_ROBOT)
    for arm, place in NAMESPACES.items():
        yield from _below(place, _RAVEN_ARM, arm)
        yield from _below(MEASURED_JS[arm].rpartition("/")[0], _SWAPPED, arm)
        yield from _below(place.replace("arm", "grasp"), _GRASP, arm, "grasp_")
    for number in (3, 4):  # arms that no robot has, to which its software listens
        for verb in ("state_command", "servo_jv"):
            yield CrtkTopic(f"/arm{number}/{verb}", *_RAVEN_ARM[verb], f"{verb}_{number}")


RAVEN_TOPICS = tuple(_raven())


def calibrated_namespace(arm: Arm, namespace: str | None = None) -> str:
    """Return the prefix of the topics of an arm's deployed model.

    Args:
        arm, namespace: Side of a RAVEN-II, or the arm's namespace, if it has one.
    """
    return f"{NAMESPACES[arm] if namespace is None else '/' + namespace.strip('/')}/calibrated"


def raven_dialect_topics(arm: str | None, namespace: str | None = None) -> tuple[CrtkTopic, ...]:
    """Return an arm's topics as the RAVEN-II's software has them, the robot's when None; a namespace is refused."""
    if namespace is not None:
        raise InputError(
            f'namespace "{namespace}": the dialect raven has none, its topics are fixed (/arm1 gold, /arm2 green); '
            "the dialect crtk has one"
        )
    return tuple(topic for topic in RAVEN_TOPICS if topic.arm == arm)


def crtk_topics(arm: str | None, namespace: str | None = None) -> tuple[CrtkTopic, ...]:
    """Return an arm's topics in the present convention; jaw verbs are jaw/VERB.

    Args:
        arm: Side of a RAVEN-II; the robot itself, which has no topics, when None.
        namespace: Namespace such as /PSM1; a RAVEN-II's own when None.
    """
    if namespace is None:
        return () if arm not in NAMESPACES else crtk_topics(arm, NAMESPACES[arm])
    words = namespace.strip("/")
    return tuple(_below(f"/{words}" if words else "", _CRTK | _ANY_JAW | _ALL_DVRKS, arm))


def console_topics(namespace: str) -> tuple[CrtkTopic, ...]:
    """Return the topics of the console of a dVRK, beside the namespace of one of its arms."""
    above = ("/" + namespace.strip("/")).rpartition("/")[0]
    return tuple(
        CrtkTopic(f"{above}/{verb.replace('console', place)}", kind, "in", verb)
        for place in ("console", "system")
        for verb, kind in (dict.fromkeys(CONSOLE_COMMANDS, SIGNAL) | _SOUNDS).items()
    )


def topics(dialect: str) -> tuple[CrtkTopic, ...]:
    """Return all topics of a RAVEN-II in a dialect."""
    kind = dialect_named(dialect)
    return tuple(topic for arm in (None, *NAMESPACES) for topic in kind.topics(arm))


def find_topic(dialect: str, verb: str, arm: Arm | None = None, namespace: str | None = None) -> CrtkTopic:
    """Return the topic of a verb.

    Args:
        verb: The verb; the gripper's begin with `jaw/` or `grasp_`.
        arm: Side of a RAVEN-II; the robot when None.
    """
    listed: tuple[CrtkTopic, ...] = dialect_named(dialect).topics(arm, namespace)
    match = next((topic for topic in listed if topic.verb == verb), None)
    if match is None:
        verbs = sorted(topic.verb for topic in listed)
        raise InputError(
            f'dialect {dialect}, {"the robot" if arm is None else f"{arm} arm"}: no topic for "{verb}"; '
            f"there are {', '.join(verbs) or 'none'}"
        )
    return match
