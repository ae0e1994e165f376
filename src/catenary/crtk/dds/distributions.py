"""What differs between ROS 2's distributions on the wire."""

import os
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from catenary.errors import InputError
from catenary.recording.messages import SERVICES, ros2_name, typestore


class Distribution(NamedTuple):
    """A distribution of ROS 2, as its programs find each other."""

    name: str
    gid: int  # bytes by which a program or a topic's end is told in ros_discovery_info
    has_hashes: bool  # topics' ends carry a hash of their type, which ROS 2 warns without


# rmw's storage of a gid had 24 bytes up to Humble; type hashes came with Iron (REP 2016)
DISTRIBUTIONS: Mapping[str, Distribution] = MappingProxyType(
    {
        name: Distribution(name, gid, has_hashes)
        for name, gid, has_hashes in (
            ("humble", 24, False),
            ("iron", 16, True),
            ("jazzy", 16, True),
            ("kilted", 16, True),
            ("rolling", 16, True),
        )
    }
)
DEFAULT = "jazzy"  # the newest with support of five years


def distribution(name: str | None = None) -> Distribution:
    """Return a distribution: the one named, else ROS_DISTRO where ROS 2's setup was sourced, else `DEFAULT`."""
    if name is None:
        return DISTRIBUTIONS.get(os.environ.get("ROS_DISTRO", ""), DISTRIBUTIONS[DEFAULT])
    if name not in DISTRIBUTIONS:
        raise InputError(f'ROS 2 distribution "{name}": expected one of {", ".join(DISTRIBUTIONS)}')
    return DISTRIBUTIONS[name]


def message_hash(name: str) -> str:
    """Return ROS 2's hash of a message type (REP 2016), by which its programs tell versions of it apart."""
    return _hash(ros2_name(name))


def half_hash(service: str, half: str) -> str:
    """Return ROS 2's hash of a service's Request or Response."""
    package, _, name = service.partition("/")
    return _hash(f"{package}/srv/{name}_{half}")


@cache
def _hash(name: str) -> str:
    return _services().hash_rihs01(name) if "/srv/" in name else typestore(2).hash_rihs01(name)


@cache
def _services() -> Typestore:
    """Return halves of services under ROS 2's names, with the messages that they contain."""
    store, halves = get_typestore(Stores.EMPTY), dict(typestore(2).fielddefs)
    for service in SERVICES:
        package, _, name = service.partition("/")
        for half in ("Request", "Response"):
            halves[f"{package}/srv/{name}_{half}"] = typestore(2).fielddefs[ros2_name(f"{service}{half}")]
    store.register(halves)
    return store
