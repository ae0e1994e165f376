"""Classes by which rospy carries messages whose bytes are made and read elsewhere.

A class of genpy's message protocol for each type: its name, md5 sum and definition, by which ROS's programs tell types
apart, and `serialize` and `deserialize`, which pass the bytes on. Imports genpy, which comes with rospy.
"""

from functools import cache
from typing import Any

import genpy

from catenary.recording.messages import full_definition, md5_sum, service_md5_sum


class RawMessage(genpy.Message):  # type: ignore[misc]  # genpy is not typed
    """A message as bytes."""

    __slots__ = ("data",)
    _slot_types: tuple[str, ...] = ()
    _has_header = False  # rospy would count in it; whoever makes the bytes does

    def __init__(self, data: bytes = b"") -> None:
        self.data = data

    def serialize(self, buffer: Any) -> None:
        """Write the bytes."""
        buffer.write(self.data)

    def deserialize(self, data: bytes) -> "RawMessage":
        """Keep the bytes."""
        self.data = data
        return self


@cache
def raw_class(name: str) -> type[RawMessage]:
    """Return the class that stands for a message type towards rospy and its peers, under the spelling given."""
    attributes = {
        "__slots__": (),
        "_type": name,
        "_md5sum": md5_sum(name),
        "_full_text": full_definition(name),
    }
    return type(name.rpartition("/")[2], (RawMessage,), attributes)


@cache
def service_class(name: str) -> type:
    """Return the class that stands for a service type towards rospy and its peers."""
    halves = {f"_{half.lower()}_class": raw_class(f"{name}{half}") for half in ("Request", "Response")}
    attributes = {"_type": name, "_md5sum": service_md5_sum(name), **halves}
    return type(name.rpartition("/")[2], (), attributes)
