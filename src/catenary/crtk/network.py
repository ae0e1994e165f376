"""Transports by name, one record each; joining ROS 1, ROS 2 or nothing by one, under a name of the program's own.

What users of ROS 2 tell any of its programs behind `--ros-args` (names of topics, of the node, its namespace) goes
before. A command's transport is made deep within it; what was said reaches it by `said_ros_arguments`.
"""

import logging
import os
import re
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Literal

from catenary.errors import InputError, MissingPackageError, to_install
from catenary.operating_system import require_linux

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.crtk.transport import Transport


BEGIN, _END = "--ros-args", "--"
_TOPIC = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
_WORD = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NODE = ("__node", "__name")


@dataclass(frozen=True)
class RosArguments:
    """Names that differ from a program's own, those of topics and services absolute; and who the others are."""

    topics: dict[str, str] = field(default_factory=dict)  # by the name that the program uses
    node: str | None = None
    namespace: str = "/"
    distro: str | None = None  # distribution of the others; ROS_DISTRO's when None
    transport: str | None = None  # rclpy or dds; the first that there is when None

    def network_name(self, name: str) -> str:
        """Return a topic's or service's name on the network."""
        return self.topics.get(name, name)

    def own_name(self, name: str) -> str | None:
        """Return this program's name of a network topic; None if that name means another topic to it."""
        own = next((own for own, other in self.topics.items() if other == name), None)
        return own or (None if name in self.topics else name)


_said: ContextVar[RosArguments | None] = ContextVar("ros_arguments", default=None)


def say_ros_arguments(arguments: RosArguments) -> None:
    """Have the command that runs now join ROS 2 so, where it does."""
    _said.set(arguments)


def said_ros_arguments() -> RosArguments:
    """Return the ROS arguments of the running command."""
    return _said.get() or RosArguments()


def split_ros_arguments(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return a command's own arguments, and those between `--ros-args` and `--` or the end."""
    own, ros, is_ros = list[str](), list[str](), False
    for word in words:
        if word == BEGIN:
            is_ros = True
        elif is_ros and word == _END:
            is_ros = False
        else:
            (ros if is_ros else own).append(word)
    return own, ros


def parse_ros_arguments(words: Sequence[str]) -> RosArguments:
    """Return the remappings of `-r FROM:=TO` (`--remap`), the last of each."""
    topics: dict[str, str] = {}
    node, namespace = None, "/"
    remaining = list(words)
    while remaining:
        word = remaining.pop(0)
        if word not in ("-r", "--remap"):
            raise InputError(f"{BEGIN}: {word}: expected -r FROM:=TO; parameters and others have no effect here")
        rule = remaining.pop(0) if remaining else ""
        old, separator, new = rule.partition(":=")
        if old in _NODE and _WORD.fullmatch(new):
            node = new
        elif old == "__ns" and (new == "/" or new.startswith("/")) and _TOPIC.fullmatch(new.lstrip("/") or "a"):
            namespace = new
        elif separator and not old.startswith("__") and _TOPIC.fullmatch(old) and _TOPIC.fullmatch(new):
            topics[f"/{old.lstrip('/')}"] = f"/{new.lstrip('/')}"
        else:
            raise InputError(
                f'{BEGIN} -r "{rule}": expected FROM:=TO of topics or services, __node:=NAME or __ns:=/NAME'
            )
    taken = [one for one in topics.values() if list(topics.values()).count(one) > 1]
    if taken:
        raise InputError(f"{BEGIN}: two names become {taken[0]}; each needs its own")
    return RosArguments(topics, node, namespace)


# whose rclpy does not say which program sent a message: a served arm could not refuse a second one there
_TELLING_NO_SENDER = ("humble", "iron", "jazzy")
_NOTHING_SAID = RosArguments()
_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class TransportKind:
    """A transport by name.

    Args:
        name: As it is typed behind `--transport`, where `--ros` leaves a choice.
        ros: What it joins, as it is typed behind `--ros`; of several, the first is taken that can be.
        made_by: `module:class` of this room; the class takes a node's name and, for ROS 2, RosArguments.
        needs: Modules that must be there besides.
        advice: What to do where it cannot be imported; else the extra named `ros2` brings it.
        is_of_a_distribution: It is part of the ROS 2 that was sourced, and of no other distribution.
    """

    name: str
    ros: Literal["1", "2", "none"]
    words: str
    made_by: str
    needs: tuple[str, ...] = ()
    advice: str = ""
    is_of_a_distribution: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"

    def suits(self, arguments: RosArguments) -> bool:
        """Return True if the transport is chosen where none is named."""
        is_told = arguments.distro is None and os.environ.get("ROS_DISTRO") not in _TELLING_NO_SENDER
        return is_told or not self.is_of_a_distribution

    def make(self, name: str, arguments: RosArguments = _NOTHING_SAID, **options: Any) -> "Transport":
        """Join as node `name`, `options` its class's own; refused without its packages, its distribution, or Linux."""
        if self.ros != "none":
            require_linux(f"ROS {self.ros}")
        if self.is_of_a_distribution and arguments.distro is not None:
            raise InputError(f"--ros-distro: does not go with --transport {self.name}, which is of one distribution")
        module, _, word = self.made_by.partition(":")
        try:
            made: Callable[..., Transport] = getattr(import_module(f"catenary.crtk.{module}"), word)
            for needed in self.needs:
                import_module(needed)
        except ImportError as error:
            raise MissingPackageError(f"transport {self.name}: {error}. {self.advice or to_install('ros2')}") from error
        if self.is_of_a_distribution and os.environ.get("ROS_DISTRO") in _TELLING_NO_SENDER:
            _logger.warning("this %s does not identify senders: two programs may command an arm", self.name)
        return made(name, arguments=arguments, **options) if self.ros == "2" else made(name, **options)


_KINDS = (
    TransportKind("rospy", "1", "ROS 1 by its own package", "ros1.transport:Ros1Transport"),
    TransportKind(
        "rclpy",
        "2",
        "the installed ROS 2, with crtk_msgs",
        "rclpy_transport:RclpyTransport",
        needs=("crtk_msgs.msg",),  # without it no state can be sent
        advice="Source the setup of a ROS 2 for this Python, and of crtk_msgs",
        is_of_a_distribution=True,
    ),
    TransportKind("dds", "2", "ROS 2 by DDS, without ROS installed", "dds.transport:DdsTransport"),
    TransportKind("loopback", "none", "within this program", "loopback:Loopback"),
)
TRANSPORTS = {kind.name: kind for kind in _KINDS}
CARRIERS = tuple(dict.fromkeys(kind.ros for kind in _KINDS))  # of messages, behind `--ros`
BY_ROS2 = {kind.name: kind for kind in _KINDS if kind.ros == "2"}  # behind `--transport`


def make_transport(ros: str, name: str) -> "Transport":
    """Join a ROS network.

    Args:
        ros: "1", "2", as `said_ros_arguments` configure it, or "none": nothing beyond this program.
    """
    arguments = said_ros_arguments()
    if ros not in CARRIERS:
        raise InputError(f'ros "{ros}": expected {", ".join(CARRIERS[:-1])} or {CARRIERS[-1]}')
    if ros != "2" and arguments != _NOTHING_SAID:
        raise InputError(f"--transport, --ros-distro and --ros-args go with ROS 2, not with --ros {ros}")
    if arguments.transport not in (None, *BY_ROS2):
        raise InputError(f'--transport "{arguments.transport}": expected one of {", ".join(BY_ROS2)}')
    if arguments.transport is not None:
        return BY_ROS2[arguments.transport].make(name, arguments)
    *others, last = (kind for kind in _KINDS if kind.ros == ros and kind.suits(arguments))
    for kind in others:
        try:
            return kind.make(name, arguments)
        except MissingPackageError as error:
            if find_spec(kind.name) is not None:
                _logger.warning("ROS 2 by %s, not by the %s that is there: %s", last.name, kind.name, error)
    return last.make(name, arguments)


def node_name(program: str, name: str | None = None) -> str:
    """Return a unique node name: ROS 1 ends the older of two programs of one name.

    Args:
        program, name: Program, for catenary_PROGRAM_PID; name that the user gives instead.
    """
    if name is None:
        return f"catenary_{re.sub(r'[^A-Za-z0-9_]', '_', program)}_{os.getpid()}"
    if not re.fullmatch(r"/?[A-Za-z]\w*", name, re.ASCII):
        raise InputError(f'--name "{name}": expected a letter, then letters, digits and underscores')
    return name.removeprefix("/")
