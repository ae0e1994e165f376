"""Messages to rclpy's classes and back.

ROS 2's header has no `seq`, its time is an object, and its setters demand exact types: `array.array` for sequences of
numbers, NumPy for arrays of fixed length, float and not int.
"""

import array
import importlib
from typing import Any

import numpy as np

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, message_class, message_fields
from catenary.errors import InputError, MissingPackageError
from catenary.recording.messages import MESSAGES, NUMBERS, TIMES, Field, current_name, fields, ros2_name


def ros2_class(name: str, kind: str = "msg") -> Any:
    """Class of a message type (`kind` "msg") or service type ("srv") in ROS 2.

    Raises:
        MissingPackageError: Its package is not installed for ROS 2; there is none for raven_2.
    """
    package, _, type_name = current_name(name).partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), type_name)
    except (ImportError, AttributeError) as error:
        hint = (
            "the RAVEN-II's own messages exist for ROS 1 only, the crtk dialect does without them"
            if package == "raven_2"
            else f"install it (apt install ros-$ROS_DISTRO-{package.replace('_', '-')}) and source ROS 2's setup file"
        )
        raise MissingPackageError(f"{ros2_name(name)}: not found in ROS 2: {hint}") from error


def to_ros2(name: str, message: Message) -> Any:
    """Return a message as an object of rclpy.

    Raises:
        InputError: A value does not fit its field.
        MissingPackageError: The type is not installed for ROS 2.
    """
    made = ros2_class(name)()
    fill_ros2(name, message, made)
    return made


def fill_ros2(name: str, message: Message, into: Any) -> None:
    """Write a message's values into an object of rclpy; see `to_ros2`."""
    for field, value in message_fields(name, message):
        if (current_name(name), field.name) == (HEADER, "seq"):
            continue
        try:
            setattr(into, field.name, _out(field, value))
        except (AssertionError, TypeError, ValueError, OverflowError) as error:
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            raise InputError(
                f"{current_name(name)}: {field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
            ) from error


def from_ros2(name: str, given: Any) -> Message:
    """Return a message from an object of rclpy; `seq` is 0."""
    values = []
    for field in fields(name):
        if (current_name(name), field.name) == (HEADER, "seq"):
            values.append(0)
        else:
            values.append(_in(field, getattr(given, field.name)))
    return message_class(name)(*values)


def _out(field: Field, value: Any) -> Any:
    if field.type in NUMBERS:
        if field.length is None:
            return _single(field.type, value)
        kind = np.dtype(NUMBERS[field.type])
        numbers = np.asarray(value)
        if numbers.ndim != 1 or (
            len(numbers) and numbers.dtype.kind not in ("iub" if kind.kind in "iu" else "iuf")
        ):
            raise TypeError(f"NumPy type {numbers.dtype}, shape {numbers.shape}")
        if kind.kind in "iu" and not np.array_equal(numbers.astype(kind), numbers):
            raise OverflowError(f"out of the range of {kind}")
        numbers = numbers.astype(kind)
        return (
            numbers
            if field.length
            else array.array({"l": "q", "L": "Q"}.get(kind.char, kind.char), numbers.tobytes())
        )
    if field.length is not None:
        if isinstance(value, str):
            raise TypeError("a single text")
        return [_out(field._replace(length=None), one) for one in value]
    if field.type in TIMES:
        times = importlib.import_module("builtin_interfaces.msg")
        sec, nanosec = divmod(value, SECOND)
        return getattr(times, field.type.capitalize())(sec=sec, nanosec=nanosec)
    return to_ros2(field.type, value) if field.type in MESSAGES else value


def _single(kind: str, value: Any) -> Any:
    if isinstance(value, str | bytes):
        raise TypeError("a text")
    if kind == "bool":
        return bool(value)
    if kind.startswith("float"):
        return float(value)
    if int(value) != value:
        raise TypeError("not a whole number")
    return int(value)


def _in(field: Field, value: Any) -> Any:
    if field.type in NUMBERS:
        return value if field.length is None else np.array(value, dtype=NUMBERS[field.type])
    if field.length is not None:
        return tuple(_in(field._replace(length=None), one) for one in value)
    if field.type in TIMES:
        return value.sec * SECOND + value.nanosec
    return from_ros2(field.type, value) if field.type in MESSAGES else value
