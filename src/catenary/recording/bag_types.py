"""Whether the message types that a bag declares are the ones that catenary knows."""

from pathlib import Path

from catenary.errors import FileFormatError
from catenary.recording.messages import MESSAGES, Field, current_name, fields, md5_sum, parse_fields

SEPARATOR = "=" * 80
_ROS2_TIMES = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}


def check_ros1_type(path: Path, topic: str, name: str, md5: str, definition: str) -> None:
    """Check a type by its md5 sum; `*`, which some writers put there, is taken for unknown and not checked.

    Raises:
        FileFormatError: It is not our version of the type; the message says which fields differ.
    """
    known = current_name(name)
    if known in MESSAGES and md5 not in ("*", md5_sum(known)):
        raise FileFormatError(
            f"{path}: topic {topic}: {name} has md5 sum {md5}, expected {md5_sum(known)}; "
            + _difference(known, definition, ros=1)
        )


def check_ros2_type(path: Path, topic: str, name: str, definition: str) -> None:
    """Check a type by its definition and those that it contains.

    Raises:
        FileFormatError: It is not our version of the type; the message says which fields differ.
    """
    known = current_name(name)
    if known not in MESSAGES or not definition:
        return
    if definition.lstrip("= \n").startswith("IDL:"):
        raise FileFormatError(
            f"{path}: topic {topic}: {name} is defined in IDL, expected ROS's .msg language"
        )
    difference = _difference(known, definition, ros=2)
    if difference:
        raise FileFormatError(
            f"{path}: topic {topic}: {name} differs from the type that catenary knows: {difference}"
        )


def _difference(name: str, text: str, *, ros: int) -> str:
    """Fields of a full definition that differ from ours, in words; empty when there are none."""
    own, *contained = text.split(SEPARATOR)
    sections = {name: own}
    for section in contained:
        title, _, body = section.strip().partition("\n")
        sections[current_name(title.removeprefix("MSG:").strip())] = body
    differences = []
    for part, body in sections.items():
        if part not in MESSAGES:
            continue
        expected = [
            f for f in fields(part) if not (ros == 2 and (part, f.name) == ("std_msgs/Header", "seq"))
        ]
        got = [_normal(f) for f in parse_fields(body)]
        if got == expected:
            continue
        lacks = [_text(f) for f in expected if f not in got]
        adds = [_text(f) for f in got if f not in expected]
        differences.append(
            f"{part} lacks [{', '.join(lacks)}] and has besides [{', '.join(adds)}]"
            if lacks or adds
            else f"{part} has its fields in another order"
        )
    return "; ".join(differences)


def _normal(field: Field) -> Field:
    kind = _ROS2_TIMES.get(field.type, field.type)
    if "/" not in kind and (inside := [m for m in MESSAGES if m.endswith(f"/{kind}")]):
        kind = inside[0]  # a type of the same package may be named without it
    return field._replace(type=current_name(kind))


def _text(field: Field) -> str:
    brackets = "" if field.length is None else f"[{field.length or ''}]"
    return f"{field.type}{brackets} {field.name}"
