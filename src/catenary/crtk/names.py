"""Topics of both dialects in which robots speak CRTK: which, of what type, who sends, how often, in what unit.

`raven` is what the public RAVEN-II software speaks (uw-biorobotics/raven2, branch crtk); `crtk` is the present
convention (collaborative-robotics.github.io, PoseStamped since 2022). The two differ in types, so one topic cannot
serve both.

Trap: the RAVEN-II publishes `measured_js` and `measured_cp` of its arms swapped, arm1 the green arm's and arm2 the gold
one's; setpoints and commands are not swapped. Ask `topic_name` for an arm, never put a name together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from catenary.errors import InputError
from catenary.recording.topics import MEASURED_JS, Arm

Dialect = Literal["raven", "crtk"]
Direction = Literal["out", "in"]  # from the robot, to the robot
JOINT_STATE = "sensor_msgs/JointState"
TRANSFORM = "geometry_msgs/TransformStamped"
POSE = "geometry_msgs/PoseStamped"
COMMAND = "crtk_msgs/StringStamped"
BUTTON = (
    "/silver_button"  # service, std_srvs/Trigger: the RAVEN-II's start button, which no public topic presses
)
BUTTON_TYPE = "std_srvs/Trigger"
FAST = 1000.0  # [Hz]


@dataclass(frozen=True)
class CrtkTopic:
    """A topic of a robot."""

    name: str
    type: str  # as it is declared: the RAVEN-II still uses a name that crtk_msgs has dropped
    direction: Direction
    rate: float | None  # [Hz] at which the robot publishes; None: whenever a client does
    unit: str  # of its numbers
    verb: str  # last word of the name
    arm: Arm | None = None  # whose; None: the robot's


def _raven() -> tuple[CrtkTopic, ...]:
    joints, poses = "rad, m", "m, unit quaternion"
    rates, old_state = "rad/s, m/s", "crtk_msgs/operating_state"
    arms: tuple[tuple[int, Arm], ...] = ((1, "gold"), (2, "green"))
    found = [
        CrtkTopic(
            "/ravenstate", "raven_2/raven_state", "out", FAST, "its own: degrees, um, counts", "ravenstate"
        ),
        CrtkTopic("/operating_state", old_state, "out", FAST, "", "operating_state"),
        CrtkTopic("/joint_states", JOINT_STATE, "out", 33.0, joints, "joint_states"),
        CrtkTopic("/state_command", COMMAND, "in", None, "", "state_command"),
        CrtkTopic("/raven_automove", "raven_2/raven_automove", "in", None, "um", "raven_automove"),
    ]
    for number, arm in arms:

        def add(
            verb: str, kind: str, direction: Direction, unit: str, place: str = "", arm: Arm = arm
        ) -> None:
            name = f"{place or f'/arm{number}'}/{verb}"  # noqa: B023  # called within this turn only
            found.append(
                CrtkTopic(name, kind, direction, FAST if direction == "out" else None, unit, verb, arm)
            )

        swapped = MEASURED_JS[arm].rpartition("/")[0]
        add("operating_state", old_state, "out", "")
        add("measured_js", JOINT_STATE, "out", joints, swapped)
        add("measured_cp", TRANSFORM, "out", poses, swapped)
        add("setpoint_js", JOINT_STATE, "out", joints)
        add("setpoint_cp", TRANSFORM, "out", poses)
        add("state_command", COMMAND, "in", "")
        add("servo_jr", JOINT_STATE, "in", joints)
        add("servo_jp", JOINT_STATE, "in", joints)
        add("servo_jv", JOINT_STATE, "in", rates)
        add("servo_cp", TRANSFORM, "in", poses)
        add("servo_cr", TRANSFORM, "in", poses)
        add("servo_cv", TRANSFORM, "in", "m/s, rotation per second")
        grasp = f"/grasp{number}"
        found.append(
            CrtkTopic(f"{grasp}/measured_js", JOINT_STATE, "out", FAST, "rad", "grasp_measured_js", arm)
        )
        found.append(CrtkTopic(f"{grasp}/servo_jr", JOINT_STATE, "in", None, "rad", "grasp_servo_jr", arm))
        found.append(CrtkTopic(f"{grasp}/servo_jp", JOINT_STATE, "in", None, "rad", "grasp_servo_jp", arm))
    for number in (3, 4):  # arms that no robot has, to which its software listens
        for verb, kind, unit in (("state_command", COMMAND, ""), ("servo_jv", JOINT_STATE, rates)):
            found.append(CrtkTopic(f"/arm{number}/{verb}", kind, "in", None, unit, f"{verb}_{number}"))
    return tuple(found)


RAVEN = _raven()
# verb: type, direction, unit
_CRTK: dict[str, tuple[str, Direction, str]] = {
    "operating_state": ("crtk_msgs/OperatingState", "out", ""),
    "measured_js": (JOINT_STATE, "out", "rad, m; rad/s, m/s; Nm, N"),
    "measured_cp": (POSE, "out", "m, unit quaternion"),
    "measured_cv": ("geometry_msgs/TwistStamped", "out", "m/s, rad/s"),
    "measured_cf": ("geometry_msgs/WrenchStamped", "out", "N, Nm"),
    "setpoint_js": (JOINT_STATE, "out", "rad, m; rad/s, m/s; Nm, N"),
    "setpoint_cp": (POSE, "out", "m, unit quaternion"),
    "state_command": (COMMAND, "in", ""),
    "servo_jp": (JOINT_STATE, "in", "rad, m"),
    "servo_jr": (JOINT_STATE, "in", "rad, m"),
    "servo_jv": (JOINT_STATE, "in", "rad/s, m/s"),
    "servo_jf": (JOINT_STATE, "in", "Nm, N"),
    "servo_cp": (POSE, "in", "m, unit quaternion"),
    "servo_cr": (POSE, "in", "m, unit quaternion"),
    "servo_cv": ("geometry_msgs/TwistStamped", "in", "m/s, rad/s"),
    "servo_cf": ("geometry_msgs/WrenchStamped", "in", "N, Nm"),
    "move_jp": (JOINT_STATE, "in", "rad, m"),
    "move_jr": (JOINT_STATE, "in", "rad, m"),
    "move_cp": (POSE, "in", "m, unit quaternion"),
    "move_cr": (POSE, "in", "m, unit quaternion"),
    "hold": ("std_msgs/Empty", "in", ""),
    "free": ("std_msgs/Empty", "in", ""),
    "use_gravity_compensation": ("std_msgs/Bool", "in", ""),
}
# verbs of a gripper, below `jaw/`
_JAW = ("measured_js", "setpoint_js", "servo_jp", "servo_jr", "servo_jf", "move_jp", "move_jr")
NAMESPACES: dict[Arm, str] = {"gold": "/arm1", "green": "/arm2"}  # of a RAVEN-II that speaks `crtk`


def calibrated_namespace(arm: Arm) -> str:
    """Return what is in front of the topics of an arm's deployed calibration model."""
    return f"{NAMESPACES[arm]}/calibrated"


def crtk_topics(namespace: str, arm: Arm | None = None, *, rate: float = FAST) -> tuple[CrtkTopic, ...]:
    """Topics of one arm in the present convention; jaw verbs are called `jaw/measured_js` and so on.

    Args:
        namespace: In front of each verb, such as /arm1 or /PSM1; empty for none.
        arm: Whose they are, where the robot has two.
        rate: [Hz] at which the robot publishes.
    """
    verbs = {**_CRTK, **{f"jaw/{verb}": _CRTK[verb] for verb in _JAW}}
    return tuple(
        CrtkTopic(
            "/" + "/".join(word for word in (namespace.strip("/"), verb) if word),
            kind, direction, rate if direction == "out" else None, unit, verb, arm,
        )
        for verb, (kind, direction, unit) in verbs.items()
    )  # fmt: skip


def topics(dialect: Dialect) -> tuple[CrtkTopic, ...]:
    """All topics of a RAVEN-II in a dialect.

    Raises:
        InputError: There is no such dialect.
    """
    if dialect == "raven":
        return RAVEN
    if dialect == "crtk":
        return tuple(topic for arm, place in NAMESPACES.items() for topic in crtk_topics(place, arm))
    raise InputError(f'dialect "{dialect}": expected raven or crtk')


def find_topic(dialect: Dialect, verb: str, arm: Arm | None = None) -> CrtkTopic:
    """Topic that carries a verb of an arm of a RAVEN-II, or of the whole robot when `arm` is None.

    Raises:
        InputError: There is no such topic.
    """
    listed = topics(dialect)
    found = next((topic for topic in listed if topic.verb == verb and topic.arm == arm), None)
    if found is None:
        verbs = sorted({topic.verb for topic in listed if topic.arm == arm})
        raise InputError(
            f'dialect {dialect}, {"the robot" if arm is None else f"{arm} arm"}: no topic for "{verb}"; '
            f"there are {', '.join(verbs) or 'none'}"
        )
    return found


def topic_name(dialect: Dialect, verb: str, arm: Arm | None = None) -> str:
    """Name of the topic that carries a verb; see `find_topic`."""
    return find_topic(dialect, verb, arm).name


def topic_finder(dialect: Dialect, arm: Arm, namespace: str | None = None) -> Callable[[str], CrtkTopic]:
    """Return a function that finds the topic of a verb of one arm.

    Args:
        dialect: Raven or crtk.
        arm: Which one.
        namespace: In front of the verbs of a robot that speaks `crtk`; a RAVEN-II's when None.

    Raises:
        InputError: There is no such dialect, or it has no namespaces.
    """
    if dialect == "raven":
        if namespace is not None:
            raise InputError(f'namespace "{namespace}": a robot that speaks raven has none; give arm')
        return lambda verb: find_topic(dialect, verb, arm)
    if dialect != "crtk":
        raise InputError(f'dialect "{dialect}": expected raven or crtk')
    listed = {t.verb: t for t in crtk_topics(NAMESPACES[arm] if namespace is None else namespace, arm)}
    return listed.__getitem__
