"""The messages that robots publish: what is in them, the sums by which ROS 1 tells versions apart.

The md5 sums that follow from data/messages.toml are the published ones.
"""

import tomllib
from collections.abc import Mapping
from functools import cache, lru_cache
from hashlib import md5
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from catenary.bounded_parsers import cut, shortened
from catenary.errors import FileFormatError

_DATA: dict[str, Any] = tomllib.loads((files("catenary.recording") / "data" / "messages.toml").read_text("utf-8"))
_OWN: Mapping[str, str] = _DATA["own"]
_STANDARD = tuple(f"{package}/{name}" for package, names in _DATA["standard"].items() for name in names.split())
_MAX_DEFINITION_CHARACTERS = 60_000  # characters of a definition without comments; moveit's longest has 20,000
MESSAGES = (*_STANDARD, *_OWN)  # types that catenary knows
SERVICES: Mapping[str, tuple[str, str]] = {name: (both[0], both[1]) for name, both in _DATA["services"].items()}
_OLD_NAMES: Mapping[str, str] = {"crtk_msgs/operating_state": "crtk_msgs/OperatingState"}

# ROS 1 type -> NumPy type, for numbers; `time` and `duration` are two of them, `string` is none
NUMBERS: Mapping[str, str] = {
    "bool": "u1", "byte": "i1", "char": "u1",
    "int8": "i1", "int16": "<i2", "int32": "<i4", "int64": "<i8",
    "uint8": "u1", "uint16": "<u2", "uint32": "<u4", "uint64": "<u8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
TIMES = ("time", "duration")
_HEADER = "std_msgs/Header"
_PLACEHOLDER = "structure_needs_at_least_one_member"  # rosbags' field of a type that has none
_TIME_NAMES = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}

_NO_TYPES = (TypesysError, ValueError, LookupError, TypeError, RecursionError, AssertionError, AttributeError)


class Field(NamedTuple):
    """One field of a message."""

    name: str
    type: str  # element's, in ROS 1's words
    length: int | None  # None: a single one; 0: any number; else that many


def current_name(name: str) -> str:
    """Return the name that catenary uses for a type: ROS 1's, without ROS 2's `/msg/`, in its present spelling."""
    plain = name.replace("/msg/", "/")
    return _OLD_NAMES.get(plain, plain)


@cache
def fields(name: str) -> tuple[Field, ...]:
    """Return the fields of a message type in order."""
    return fields_of(typestore().fielddefs[_known(name)][1])


def fields_of(definitions: list[tuple[str, FieldDesc]]) -> tuple[Field, ...]:
    """Return rosbags' fields of a message in ROS 1's words."""
    return tuple(_field(name, kind) for name, kind in definitions if name != _PLACEHOLDER)


@cache
def full_definition(name: str) -> str:
    """Return a type's definition with those of all types it contains, as ROS 1 stores it in bags."""
    return typestore().generate_msgdef(_known(name), ros_version=1)[0]


@cache
def md5_sum(name: str) -> str:
    """Return the sum by which ROS 1 tells versions of a type apart."""
    return typestore().generate_msgdef(_known(name), ros_version=1)[1]


@cache
def service_md5_sum(name: str) -> str:
    """Return the sum by which ROS 1 tells versions of a service apart; a message's type stands as its own sum."""
    if name not in SERVICES:
        raise FileFormatError(f'service type "{name}": unknown; known are {", ".join(sorted(SERVICES))}')
    halves = [[line.split() for line in half.strip().splitlines()] for half in SERVICES[name]]
    sums = [[f"{md5_sum(t) if current_name(t) in MESSAGES else t} {field}" for t, field in half] for half in halves]
    return md5("".join(map("\n".join, sums)).encode(), usedforsecurity=False).hexdigest()


@cache
def typestore(ros: int = 1) -> Typestore:
    """Return rosbags' store of these types, ROS 1's or ROS 2's, the halves of services among them.

    ROS 2's header lacks `seq`. Names of types and fields stay as they are, although ROS 2's own compilers would
    refuse `raven_state` and `encVals`: readers of MCAP take the definition from the file.
    """
    noetic = get_typestore(Stores.ROS1_NOETIC).fielddefs
    times = noetic if ros == 1 else get_typestore(Stores.LATEST).fielddefs
    types: Typesdict = {name: times[name] for name in map(ros2_name, _TIME_NAMES)}
    types |= {name: noetic[name] for name in map(ros2_name, _STANDARD)}
    if ros == 2:
        constants, parts = types[ros2_name(_HEADER)]
        types[ros2_name(_HEADER)] = constants, [part for part in parts if part[0] != "seq"]
    for name, text in _OWN.items():
        types |= get_types_from_msg(text, name)
    for old, new in _OLD_NAMES.items():
        types |= get_types_from_msg(_OWN[new], old)
    for name, (request, response) in SERVICES.items():
        types |= get_types_from_msg(request, f"{name}Request") | get_types_from_msg(response, f"{name}Response")
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def ros2_name(name: str) -> str:
    """Return a type's name in ROS 2, such as sensor_msgs/msg/JointState."""
    package, message = current_name(name).split("/")
    return f"{package}/msg/{message}"


def check_type(path: Path, topic: str, name: str, definition: str, *, ros: int = 2) -> None:
    """Check a type by its definition and those that it contains."""
    if current_name(name) not in MESSAGES or not definition:
        return
    where = f"{path}: topic {cut(topic)}: {cut(name)}"
    difference = _difference(types_of(where, current_name(name), definition), ros)
    if difference:
        raise FileFormatError(f"{where} differs from the type that catenary knows: {difference}")


@lru_cache(maxsize=64)
def types_of(where: str, name: str, definition: str) -> Typesdict:
    """Return the types in a message's definition, in .msg or in IDL."""
    is_idl = definition.lstrip("= \n").startswith("IDL:")
    lines = (line.split("#")[0].rstrip() if "=" not in line else line for line in definition.split("\n"))
    plain = definition if is_idl else "\n".join(line for line in lines if line.strip())
    if len(plain) > _MAX_DEFINITION_CHARACTERS:
        raise FileFormatError(
            f"{where}: its definition has {len(plain)} characters, expected {_MAX_DEFINITION_CHARACTERS} at most"
        )
    try:
        return get_types_from_idl(plain) if is_idl else get_types_from_msg(plain, name)
    except _NO_TYPES as error:
        raise FileFormatError(f"{where}: its definition cannot be read: {shortened(str(error))}") from error


def _known(name: str) -> str:
    """Name of a type in the store."""
    if "/" not in current_name(name) or ros2_name(name) not in typestore().fielddefs:
        raise FileFormatError(f'message type "{name}": unknown; known are {", ".join(sorted(MESSAGES))}')
    return ros2_name(name)


def _field(name: str, description: FieldDesc) -> Field:
    if description[0] == Nodetype.BASE:
        return Field(name, description[1][0], None)
    if description[0] == Nodetype.NAME:
        plain = current_name(description[1])
        return Field(name, _TIME_NAMES.get(plain, plain), None)
    element, length = description[1]
    return _field(name, element)._replace(length=length)


def _difference(types: Typesdict, ros: int) -> str:
    """Return in words the fields of types that differ from ours; empty when there are none."""
    differences = []
    for part in map(current_name, types):
        if part not in MESSAGES:
            continue
        expected = fields_of(typestore(ros).fielddefs[ros2_name(part)][1])
        got = fields_of(types[ros2_name(part)][1])
        lacks = ", ".join(_text(f) for f in expected if f not in got)
        adds = ", ".join(_text(f) for f in got if f not in expected)
        if lacks or adds:
            differences.append(f"{part} lacks [{lacks}] and has besides [{adds}]")
        elif got != expected:
            differences.append(f"{part} has its fields in another order")
    return "; ".join(differences)


def _text(field: Field) -> str:
    brackets = "" if field.length is None else f"[{field.length or ''}]"
    return f"{field.type}{brackets} {field.name}"
