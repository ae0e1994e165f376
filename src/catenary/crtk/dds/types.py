"""DDS's types, made at run time from the descriptions that ROS 1's messages have too.

What an instance carries is the message's bytes (CDR), made and read elsewhere: `serialize` and `deserialize` pass them
on. DDS itself needs the fields to tell types apart and to refuse bytes that are no message of the type.
"""

from functools import cache
from types import new_class
from typing import Any

from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as idl

from catenary.crtk.dds.names import dds_half, dds_type
from catenary.recording.messages import Field, fields

_NUMBERS = {
    "bool": bool, "byte": idl.uint8, "char": idl.uint8,
    "int8": idl.int8, "int16": idl.int16, "int32": idl.int32, "int64": idl.int64,
    "uint8": idl.uint8, "uint16": idl.uint16, "uint32": idl.uint32, "uint64": idl.uint64,
    "float32": idl.float32, "float64": idl.float64,
}  # fmt: skip
_TIMES = {
    "time": ("builtin_interfaces/Time", {"sec": idl.int32, "nanosec": idl.uint32}),
    "duration": ("builtin_interfaces/Duration", {"sec": idl.int32, "nanosec": idl.uint32}),
}
_EMPTY = {"structure_needs_at_least_one_member": idl.uint8}  # ROS 2's field of a type that has none
_ASKED = {"guid": idl.uint64, "seq": idl.int64}  # rmw_cyclonedds: who asks, and how often it has
# their brackets make types, which their hints do not know
array: Any = idl.array
sequence: Any = idl.sequence
Raw = Any  # an instance: made of bytes, which are its `data`


@cache
def message_type(name: str) -> type[Raw]:
    """Return DDS's class of a message type."""
    return _raw(dds_type(name), _members(name))


@cache
def half_type(service: str, half: str) -> type[Raw]:
    """Return DDS's class of a service's Request or Response, which begins with who asks."""
    return _raw(dds_half(service, half), {**_ASKED, **_members(f"{service}{half}")})


def _members(name: str) -> dict[str, Any]:
    listed = {field.name: _member(field) for field in fields(name) if not _is_dropped(name, field)}
    return listed or dict(_EMPTY)


def _is_dropped(name: str, field: Field) -> bool:
    return name == "std_msgs/Header" and field.name == "seq"  # which ROS 2's has not


def _member(field: Field) -> Any:
    if field.length is not None:
        single = _member(field._replace(length=None))
        return array[single, field.length] if field.length else sequence[single]
    if field.type in _NUMBERS:
        return _NUMBERS[field.type]
    if field.type in _TIMES:
        name, members = _TIMES[field.type]
        return _time(dds_type(name), tuple(members.items()))
    return str if field.type == "string" else message_type(field.type)


@cache
def _time(name: str, members: tuple[tuple[str, Any], ...]) -> type[Raw]:
    return _raw(name, dict(members))


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
