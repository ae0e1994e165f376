"""Message types as a bag defines them, or ROS where the bag does not say."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from catenary.documents import cut, shortened
from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagConnection
from catenary.recording.layout import Encoding
from catenary.recording.messages import NUMBERS, TIMES, Field, current_name, fields_of, ros2_name

MAX_TEXT = 60_000  # characters of a definition without comments; moveit's longest has 20,000
DEEPEST = 32  # messages within each other
_SAME = {"octet": "uint8"}  # ROS 2's words for ROS 1's


def fields_by_definition(
    path: Path, connection: BagConnection, encoding: Encoding
) -> Callable[[str], tuple[Field, ...]]:
    """Return what gives the fields of a topic's message type and of those within it."""
    where = f"{path}: topic {cut(connection.topic)}: type {cut(connection.type)}"
    types = _types(where, connection, encoding)
    known: dict[str, tuple[Field, ...]] = {}
    deepest: dict[str, int] = {}

    def depth(name: str, above: tuple[str, ...]) -> int:
        if name in above or len(above) > DEEPEST:
            raise FileFormatError(
                f"{where}: {cut(name)} holds itself, or is more than {DEEPEST} messages deep"
            )
        if name not in deepest:
            if ros2_name(name) not in types:
                raise FileFormatError(f"{where}: {cut(name)}, which is in it, is not defined")
            known[name] = tuple(_plain(field) for field in fields_of(types[ros2_name(name)][1]))
            inner = {f.type for f in known[name]} - set(NUMBERS) - {*TIMES, "string"}
            strange = sorted(kind for kind in inner if "/" not in kind)
            if strange:
                raise FileFormatError(f"{where}: has a {cut(strange[0])}, which is not read")
            deepest[name] = 1 + max((depth(kind, (*above, name)) for kind in inner), default=0)
        return deepest[name]

    depth(current_name(connection.type), ())
    return known.__getitem__


def _types(where: str, connection: BagConnection, encoding: Encoding) -> Typesdict:
    text = connection.definition
    if not text.strip():
        return _of_ros(encoding)
    if len(text) > 4 * MAX_TEXT:
        raise FileFormatError(
            f"{where}: its definition has {len(text)} characters, expected {MAX_TEXT} at most"
        )
    is_idl = text.lstrip("= \n").startswith("IDL:")
    lines = (line.split("#")[0].rstrip() if "=" not in line else line for line in text.split("\n"))
    plain = text if is_idl else "\n".join(line for line in lines if line.strip())
    if len(plain) > MAX_TEXT:
        raise FileFormatError(
            f"{where}: its definition has {len(plain)} characters, expected {MAX_TEXT} at most"
        )
    try:
        found = get_types_from_idl(plain) if is_idl else get_types_from_msg(plain, connection.type)
    except (
        TypesysError, ValueError, LookupError, TypeError, RecursionError, AssertionError, AttributeError,
    ) as error:  # fmt: skip
        raise FileFormatError(f"{where}: its definition cannot be read: {shortened(str(error))}") from error
    return _of_ros(encoding) | found


@cache
def _of_ros(encoding: Encoding) -> Typesdict:
    return dict(get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE).fielddefs)


def _plain(field: Field) -> Field:
    return field._replace(type=_SAME.get(field.type, current_name(field.type)))
