"""What users of ROS 2 tell any of its programs, behind `--ros-args`: names of topics, of the node, its namespace.

A command's transport is made deep within it; what was said on the command line reaches it by `said_ros_arguments`.
"""

import re
from collections.abc import Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field

from catenary.errors import InputError

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
        """Return what a topic or service is called on the network."""
        return self.topics.get(name, name)

    def own_name(self, name: str) -> str | None:
        """Return what this program calls a topic of the network, or None where that name means another one to it."""
        own = next((own for own, other in self.topics.items() if other == name), None)
        return own or (None if name in self.topics else name)


_said: ContextVar[RosArguments | None] = ContextVar("ros_arguments", default=None)


def say_ros_arguments(arguments: RosArguments) -> None:
    """Have the command that runs now join ROS 2 so, where it does."""
    _said.set(arguments)


def said_ros_arguments() -> RosArguments:
    """Return what was said for the command that runs now."""
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
    """Return what `-r FROM:=TO` (`--remap`) say, the last of each."""
    topics: dict[str, str] = {}
    node, namespace = None, "/"
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word not in ("-r", "--remap"):
            raise InputError(f"{BEGIN}: {word}: expected -r FROM:=TO; parameters and others have no effect here")
        rule = rest.pop(0) if rest else ""
        old, found, new = rule.partition(":=")
        if old in _NODE and _WORD.fullmatch(new):
            node = new
        elif old == "__ns" and (new == "/" or new.startswith("/")) and _TOPIC.fullmatch(new.lstrip("/") or "a"):
            namespace = new
        elif found and not old.startswith("__") and _TOPIC.fullmatch(old) and _TOPIC.fullmatch(new):
            topics[f"/{old.lstrip('/')}"] = f"/{new.lstrip('/')}"
        else:
            raise InputError(
                f'{BEGIN} -r "{rule}": expected FROM:=TO of topics or services, __node:=NAME or __ns:=/NAME'
            )
    taken = [one for one in topics.values() if list(topics.values()).count(one) > 1]
    if taken:
        raise InputError(f"{BEGIN}: two names become {taken[0]}; each needs one of its own")
    return RosArguments(topics, node, namespace)
