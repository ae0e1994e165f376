"""ROS 2's names, types and their hashes in DDS, and what differs between its distributions.

Topic `/arm1/measured_js` is DDS's `rt/arm1/measured_js`; type sensor_msgs/msg/JointState is
`sensor_msgs::msg::dds_::JointState_`. (ROS 2's design, "Topic and Service name mapping to DDS".)

Types are made at run time from the descriptions that ROS 1's messages have too. What an instance carries is the
message's bytes (CDR), made and read elsewhere; DDS itself needs the fields to tell types apart and to refuse bytes that
are no message of the type.
"""

import os
import re
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType, new_class
from typing import Any, NamedTuple

from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as idl

from catenary.crtk.message import HEADER
from catenary.errors import InputError
from catenary.recording.messages import NUMBERS, Field, current_name, fields, ros2_name, typestore

DISCOVERY = "ros_discovery_info"  # where each program tells which nodes it has; no topic of ROS
_TYPE = re.compile(r"(\w+)::msg::dds_::(\w+)_")


def dds_topic(topic: str) -> str:
    """Return DDS's name of a topic."""
    return f"rt{topic}"


def ros_topic(name: str) -> str | None:
    """Return the topic that DDS calls so, or None where it is none of ROS."""
    return name[2:] if name.startswith("rt/") else None


def dds_type(name: str) -> str:
    """Return DDS's name of a message type, or of a field's."""
    package, _, message = current_name(name).partition("/")
    return f"{package}::msg::dds_::{message}_"


def ros_type(name: str) -> str:
    """Return the message type that DDS calls so; a name that is none of ROS's as it is."""
    found = _TYPE.fullmatch(name)
    return current_name(f"{found[1]}/{found[2]}") if found else name


class Distribution(NamedTuple):
    """A distribution of ROS 2, as its programs find each other."""

    gid: int  # bytes by which a program or a topic's end is told in ros_discovery_info
    has_hashes: bool  # topics' ends carry a hash of their type, which ROS 2 warns without

    def said_of(self, type_hash: str) -> str:
        """Return what the end of a topic says of its type, in its user data."""
        return f"typehash={type_hash};" if self.has_hashes else ""


# rmw's storage of a gid had 24 bytes up to Humble; type hashes came with Iron (REP 2016)
_DISTRIBUTIONS: Mapping[str, Distribution] = MappingProxyType(
    {"humble": Distribution(24, False)} | dict.fromkeys(("iron", "jazzy", "kilted", "rolling"), Distribution(16, True))
)
_DEFAULT_DISTRIBUTION = "jazzy"  # the newest with support of five years


def distribution(name: str | None = None) -> Distribution:
    """Return a distribution: the one named, else ROS_DISTRO where ROS 2's setup was sourced, else jazzy."""
    if name is None:
        return _DISTRIBUTIONS.get(os.environ.get("ROS_DISTRO", ""), _DISTRIBUTIONS[_DEFAULT_DISTRIBUTION])
    if name not in _DISTRIBUTIONS:
        raise InputError(f'ROS 2 distribution "{name}": expected one of {", ".join(_DISTRIBUTIONS)}')
    return _DISTRIBUTIONS[name]


@cache
def message_hash(name: str) -> str:
    """Return ROS 2's hash of a message type (REP 2016), by which its programs tell versions of it apart."""
    return typestore(2).hash_rihs01(ros2_name(name))


_NUMBERS = {name: getattr(idl, name) for name in NUMBERS if name not in ("bool", "byte", "char")}
_NUMBERS |= {"bool": bool, "byte": idl.uint8, "char": idl.uint8}
_TIMES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
_EMPTY = {"structure_needs_at_least_one_member": idl.uint8}  # ROS 2's field of a type that has none
# their brackets make types, which their hints do not know
array: Any = idl.array
sequence: Any = idl.sequence
Raw = Any  # an instance: made of bytes, which are its `data`


@cache
def message_type(name: str) -> type[Raw]:
    """Return DDS's class of a message type."""
    return _raw(dds_type(name), _members(name))


def _members(name: str) -> dict[str, Any]:
    dropped = "seq" if name == HEADER else ""  # which ROS 2's has not
    return {field.name: _member(field) for field in fields(name) if field.name != dropped} or dict(_EMPTY)


def _member(field: Field) -> Any:
    if field.length is not None:
        single = _member(field._replace(length=None))
        return array[single, field.length] if field.length else sequence[single]
    if field.type in _NUMBERS:
        return _NUMBERS[field.type]
    if field.type in _TIMES:
        return _time(dds_type(_TIMES[field.type]))
    return str if field.type == "string" else message_type(field.type)


@cache
def _time(name: str) -> type[Raw]:
    return _raw(name, {"sec": idl.int32, "nanosec": idl.uint32})


def _raw(typename: str, members: dict[str, Any]) -> type[Raw]:
    """Return a class of DDS's, of these fields, whose instances are bytes."""

    def begin(self: Raw, data: bytes) -> None:
        self.data = data

    def body(namespace: dict[str, Any]) -> None:
        namespace["__annotations__"].update(members)
        namespace["__init__"] = begin
        namespace["serialize"] = lambda self, *_, **__: self.data
        namespace["deserialize"] = classmethod(lambda made, data, *_, **__: made(data))
        namespace["deserialize_key"] = classmethod(lambda made, *_, **__: made(b""))  # it has none

    return new_class(typename.rpartition("::")[2], (IdlStruct,), {"typename": typename}, body)
