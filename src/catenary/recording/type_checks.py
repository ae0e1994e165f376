"""Checks that the message types which a recording declares are the ones that catenary knows."""

from pathlib import Path

from rosbags.typesys import TypesysError, get_types_from_msg

from catenary.errors import FileFormatError
from catenary.recording.messages import (
    MESSAGES,
    Field,
    current_name,
    fields_of,
    md5_sum,
    ros2_name,
    typestore,
)


def check_ros1_type(path: Path, topic: str, name: str, md5: str, definition: str) -> None:
    """Check a type by its md5 sum; `*`, which some writers put there, is taken for unknown and not checked.

    Raises:
        FileFormatError: It is not our version of the type; the message says which fields differ.
    """
    known = current_name(name)
    if known in MESSAGES and md5 not in ("*", md5_sum(known)):
        raise FileFormatError(
            f"{path}: topic {topic}: {name} has md5 sum {md5}, expected {md5_sum(known)}; "
            + _difference(path, topic, name, definition, ros=1)
        )


def check_ros2_type(path: Path, topic: str, name: str, definition: str) -> None:
    """Check a type by its definition and those that it contains.

    Raises:
        FileFormatError: It is not our version of the type; the message says which fields differ.
    """
    if current_name(name) not in MESSAGES or not definition:
        return
    if definition.lstrip("= \n").startswith("IDL:"):
        raise FileFormatError(
            f"{path}: topic {topic}: {name} is defined in IDL, expected ROS's .msg language"
        )
    difference = _difference(path, topic, name, definition, ros=2)
    if difference:
        raise FileFormatError(
            f"{path}: topic {topic}: {name} differs from the type that catenary knows: {difference}"
        )


def _difference(path: Path, topic: str, name: str, text: str, *, ros: int) -> str:
    """Return in words the fields of a full definition that differ from ours; empty when there are none."""
    try:
        found = get_types_from_msg(text, current_name(name))
    except TypesysError as error:
        raise FileFormatError(
            f"{path}: topic {topic}: definition of {name}: expected ROS's .msg language, got {text!r}"
        ) from error
    differences = []
    for part in map(current_name, found):
        if part not in MESSAGES:
            continue
        expected = fields_of(typestore(ros).fielddefs[ros2_name(part)][1])
        got = fields_of(found[ros2_name(part)][1])
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
