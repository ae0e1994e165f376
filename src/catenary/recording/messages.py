"""The messages that robots publish: what is in them, the sums by which ROS 1 tells versions apart, their bytes.

Field lists: raven_2 from uw-biorobotics/raven2 (msg/), crtk_msgs from collaborative-robotics/crtk_msgs, the rest from
ROS's common messages. The md5 sums that follow from them are the published ones.
"""

import re
from collections.abc import Mapping
from functools import cache
from hashlib import md5
from types import MappingProxyType
from typing import NamedTuple

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from catenary.errors import FileFormatError

# first name in each line is the type, the second the field; order and names make the md5 sum
MESSAGES: Mapping[str, str] = MappingProxyType(
    {
        "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
        "std_msgs/String": "string data\n",
        "std_msgs/Bool": "bool data\n",
        "std_msgs/Empty": "",
        "sensor_msgs/JointState": (
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        ),
        "sensor_msgs/Joy": "std_msgs/Header header\nfloat32[] axes\nint32[] buttons\n",
        "sensor_msgs/Imu": (
            "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
            "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
            "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
        ),
        "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
        "geometry_msgs/Vector3Stamped": "std_msgs/Header header\ngeometry_msgs/Vector3 vector\n",
        "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
        "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
        "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
        "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        "geometry_msgs/Accel": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        "geometry_msgs/AccelStamped": "std_msgs/Header header\ngeometry_msgs/Accel accel\n",
        "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
        "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        "geometry_msgs/TransformStamped": (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
        ),
        "crtk_msgs/OperatingState": "std_msgs/Header header\nstring state\nbool is_homed\nbool is_busy\n",
        "crtk_msgs/StringStamped": "std_msgs/Header header\nstring string\n",
        "raven_2/raven_automove": (
            "std_msgs/Header hdr\nint32[6] del_pos\ngeometry_msgs/Transform[2] tf_incr\n"
        ),
        "raven_2/raven_state": (
            "std_msgs/Header hdr\nint32 runlevel\nint32 sublevel\nint32 last_seq\nint32[2] type\n"
            "int32[6] pos\nfloat32[18] ori\nfloat32[18] ori_d\nint32[6] pos_d\nduration dt\n"
            "int32[16] encVals\nint32[16] dac_val\nfloat32[16] tau\nfloat32[16] mpos\nfloat32[16] jpos\n"
            "float32[16] mvel\nfloat32[16] jvel\nfloat32[16] mpos_d\nfloat32[16] jpos_d\nfloat32[2] grasp_d\n"
            "float32[16] encoffsets\nfloat32[12] jac_vel\nfloat32[12] jac_f\n"
        ),
    }
)
# request, response
SERVICES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {"std_srvs/Trigger": ("", "bool success\nstring message\n")}
)
_HALVES: Mapping[str, str] = MappingProxyType(
    {
        f"{name}{half}": text
        for name, texts in SERVICES.items()
        for half, text in zip(("Request", "Response"), texts, strict=True)
    }
)
OLD_NAMES: Mapping[str, str] = MappingProxyType({"crtk_msgs/operating_state": "crtk_msgs/OperatingState"})

# ROS 1 type -> NumPy type, for numbers; `time` and `duration` are two of them, `string` is none
NUMBERS: Mapping[str, str] = MappingProxyType(
    {
        "bool": "u1", "byte": "i1", "char": "u1",
        "int8": "i1", "int16": "<i2", "int32": "<i4", "int64": "<i8",
        "uint8": "u1", "uint16": "<u2", "uint32": "<u4", "uint64": "<u8",
        "float32": "<f4", "float64": "<f8",
    }
)  # fmt: skip
TIMES = ("time", "duration")
_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])?\s+(\w+)$")


class Field(NamedTuple):
    """One field of a message."""

    name: str
    type: str  # element's, in ROS 1's words
    length: int | None  # None: a single one; 0: any number; else that many


def current_name(name: str) -> str:
    """Name that catenary uses for a type: ROS 1's, without ROS 2's `/msg/`, in its present spelling."""
    plain = name.replace("/msg/", "/")
    return OLD_NAMES.get(plain, plain)


@cache
def fields(name: str) -> tuple[Field, ...]:
    """Fields of a message type in order.

    Raises:
        FileFormatError: The type is not one that catenary knows.
    """
    return parse_fields(definition(name))


def parse_fields(text: str) -> tuple[Field, ...]:
    """Fields of a definition in ROS's `.msg` language, constants left out, a bare `Header` spelled out.

    Raises:
        FileFormatError: A line is not in that language.
    """
    found = []
    for line in text.splitlines():
        stripped = line.split("#", 1)[0].strip()
        if not stripped or "=" in stripped:
            continue
        match = _FIELD.match(stripped)
        if match is None:
            raise FileFormatError(f'message definition: expected "type name", got "{line}"')
        kind, array, count, field = match.groups()
        kind = "std_msgs/Header" if kind == "Header" else kind
        found.append(Field(field, kind, None if array is None else int(count or 0)))
    return tuple(found)


def definition(name: str) -> str:
    """Definition of a message type by itself, in ROS's `.msg` language; also of a service's Request, Response.

    Raises:
        FileFormatError: The type is not one that catenary knows.
    """
    found = MESSAGES.get(current_name(name), _HALVES.get(name))
    if found is None:
        raise FileFormatError(f'message type "{name}": unknown; known are {", ".join(sorted(MESSAGES))}')
    return found


def full_definition(name: str) -> str:
    """Definition with those of all types it contains, as ROS 1 stores it in bags."""
    parts = [definition(name)]
    parts += [f"{'=' * 80}\nMSG: {part}\n{definition(part)}" for part in _contained(name)]
    return "".join(parts)


@cache
def md5_sum(name: str) -> str:
    """Sum by which ROS 1 tells versions of a type apart.

    The rule [genmsg, gentools.compute_md5_text]: the definition without comments, constants first, each field as
    "type name", a message type replaced by its own sum, the array's brackets kept for built-in types only.
    """
    return md5(_sum_text(name).encode(), usedforsecurity=False).hexdigest()


@cache
def service_md5_sum(name: str) -> str:
    """Sum by which ROS 1 tells versions of a service apart: of request and response, one after the other.

    Raises:
        FileFormatError: The service is not one that catenary knows.
    """
    if name not in SERVICES:
        raise FileFormatError(f'service type "{name}": unknown; known are {", ".join(sorted(SERVICES))}')
    text = _sum_text(f"{name}Request") + _sum_text(f"{name}Response")
    return md5(text.encode(), usedforsecurity=False).hexdigest()


def _sum_text(name: str) -> str:
    lines = []
    for field in fields(name):
        if field.type in MESSAGES:
            lines.append(f"{md5_sum(field.type)} {field.name}")
        else:
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            lines.append(f"{field.type}{brackets} {field.name}")
    return "\n".join(lines)


@cache
def typestore(ros: int = 1) -> Typestore:
    """Rosbags' store of these types, ROS 1's or ROS 2's.

    ROS 2's header lacks `seq`. Names of types and fields stay as they are, although ROS 2's own compilers would
    refuse `raven_state` and `encVals`: readers of MCAP take the definition from the file.
    """
    types: Typesdict = {}
    for name, text in (*MESSAGES.items(), *_HALVES.items()):
        if ros == 2 and name == "std_msgs/Header":
            text = text.replace("uint32 seq\n", "")
        types.update(get_types_from_msg(text, name))
    for old, new in OLD_NAMES.items():
        types.update(get_types_from_msg(MESSAGES[new], old))
    store = get_typestore(Stores.EMPTY)
    if ros == 2:
        times = get_typestore(Stores.LATEST).fielddefs
    else:
        times = get_typestore(Stores.ROS1_NOETIC).fielddefs
    types.update({n: times[n] for n in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")})
    store.register(types)
    return store


def ros2_name(name: str) -> str:
    """Name of a type in ROS 2, such as sensor_msgs/msg/JointState."""
    package, message = current_name(name).split("/")
    return f"{package}/msg/{message}"


def _contained(name: str) -> list[str]:
    """Message types within a type, each once, in the order in which they are met."""
    found: list[str] = []
    for field in fields(name):
        if field.type in MESSAGES:
            found += [part for part in (field.type, *_contained(field.type)) if part not in found]
    return found
