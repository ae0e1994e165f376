"""Messages as Python sees them: one immutable tuple type per message type, made from recording's definitions.

Fields have ROS's names. A time or duration is a whole number of nanoseconds; a string is a `str`; `string[]` and
arrays of messages are tuples; arrays of numbers are NumPy arrays. Messages are the same over every transport.
"""

from collections import namedtuple
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from catenary.errors import InputError
from catenary.recording.messages import MESSAGES, NUMBERS, TIMES, Field, current_name, fields

# made at run time, so mypy sees no fields; `MESSAGES` says which there are
Message = Any
HEADER = "std_msgs/Header"


@cache
def message_class(name: str) -> Any:
    """Return the tuple type of a message type, such as crtk_msgs/StringStamped; what is not given is zero or empty."""
    if current_name(name) != name:
        return message_class(current_name(name))
    parts = fields(name)
    make: Any = namedtuple  # its checkers want literals
    made = make(name.rpartition("/")[2], [field.name for field in parts], defaults=[_default(field) for field in parts])
    made.__doc__ = f"{name}: {', '.join(f'{field.type} {field.name}' for field in parts)}"
    return made


def header(stamp: int, frame_id: str = "") -> Message:
    """Return a message header; `seq` is counted by the publisher.

    Args:
        stamp, frame_id: Time [ns], and frame of the message's numbers.
    """
    return message_class(HEADER)(0, stamp, frame_id)


def has_header(name: str) -> bool:
    """Return True if a type begins with a header."""
    parts = fields(name)
    return bool(parts) and parts[0].type == HEADER and parts[0].length is None


def stamp_of(message: Message) -> int | None:
    """Return the stamp [ns] of a message's header, or None if it has no header."""
    first = message[0] if message else None
    return first.stamp if isinstance(first, message_class(HEADER)) else None


def message_fields(name: str, message: Message) -> Iterator[tuple[Field, Any]]:
    """Return the fields of a message with their values."""
    if not isinstance(message, message_class(name)):
        raise InputError(f"expected a message {current_name(name)}, got {type(message).__name__}: {message!r}")
    return zip(fields(name), message, strict=True)


def _default(field: Field) -> Any:
    if field.type in NUMBERS:
        if field.length is not None:
            zeros = np.zeros(field.length, dtype=NUMBERS[field.type])
            zeros.setflags(write=False)  # shared by all messages that do not give it
            return zeros
        return False if field.type == "bool" else 0.0 if field.type.startswith("float") else 0
    if field.length is not None:
        single = _default(field._replace(length=None))
        return (single,) * field.length
    if field.type in TIMES:
        return 0
    if field.type in MESSAGES:
        return message_class(field.type)()
    return ""
