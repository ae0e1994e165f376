"""ROS 1 behind the transport protocol, by rospy, which is imported only when a transport is made.

Topic and service names are taken as they are, from the root: no namespace and no remapping. Time is the machine's;
`/use_sim_time` is not looked at. When the master dies, connected topics go on, and everything is registered again when
it is back, which rospy alone does not do.
"""

import importlib
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

from catenary.crtk.ros1.master import master_uri
from catenary.crtk.transport import Answer, HeardTopic, Publisher, Transport, other_type
from catenary.errors import MissingPackageError, TransportError
from catenary.recording.messages import current_name

# where Debian and ROS noetic put it, for the system's Python
_FOLDERS = (Path("/usr/lib/python3/dist-packages"), Path("/opt/ros/noetic/lib/python3/dist-packages"))


def make_rospy_importable() -> None:
    """Find rospy, where need be outside this environment."""
    if importlib.util.find_spec("rospy") is not None:
        return
    if _system_python() == sys.version_info[:2]:
        for folder in _FOLDERS:
            if (folder / "rospy" / "__init__.py").is_file():
                sys.path.append(str(folder))
                importlib.invalidate_caches()
                return
    version = ".".join(map(str, sys.version_info[:2]))
    raise MissingPackageError(
        f"rospy: not found for Python {version}. On Debian 12, with its Python 3.11: apt install python3-rospy "
        "python3-rosmaster. Without ROS, the loopback transport carries messages within one process"
    )


def _system_python() -> tuple[int, int] | None:
    """Return the version of Python for which the system's packages are made."""
    try:
        name = Path("/usr/bin/python3").resolve(strict=True).name
        major, _, minor = name.removeprefix("python").partition(".")
        return int(major), int(minor)
    except (OSError, ValueError):
        return None


_open: "Ros1Transport | None" = None  # rospy has one node a process


class Ros1Transport(Transport):
    """This process's ROS 1 node; one at a time, under one name until the process ends."""

    def __init__(self, name: str, uri: str | None = None) -> None:
        """Join the network of the master at `uri`, ROS_MASTER_URI's when None; a running node's name is refused."""
        global _open
        super().__init__(name)
        make_rospy_importable()
        if _open is not None:
            raise TransportError(f'this process has the ROS 1 transport "{_open.name}"; close that one first')
        self.node = importlib.import_module("catenary.crtk.ros1.node").node(name, master_uri(uri))
        self.node.on_shutdown = self.inbox.close
        _open = self

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> Publisher:
        """Begin to publish; `queue` counts messages beyond what the system's socket holds."""
        return self.node.publisher(topic, type_name, latch=latch, queue=queue)

    def _hear(self, topic: str, type_name: str) -> HeardTopic:
        return self.node.topic(topic, type_name, self.steady)

    def _refuse_other_type(self, topic: str, type_name: str) -> None:
        """Refuse what rospy would only mention in a log, while nothing arrives."""
        published = self.node.master.topics().get(topic)
        if published is None or current_name(published) == current_name(type_name):
            return
        names = self.node.master.publisher_names().get(topic, frozenset())
        if self.node.master.living(topic, names):  # not only one that crashed
            raise other_type(topic, type_name, published)

    def _serve(self, name: str, type_name: str, answer: Answer) -> None:
        if name in self.node.services or self.node.master.service_answers(name):
            raise TransportError(f"service {name} is offered already")
        self.node.serve(name, type_name, lambda data: self._polled(answer, data))

    def _published(self) -> Iterator[tuple[str, str, str]]:
        types = self.node.master.topics()
        for topic, processes in self.node.master.publishing().items():  # also those that do not answer
            for process in processes if topic in types else ():
                yield topic, current_name(types[topic]), process

    def _others(self, topic: str) -> frozenset[str]:
        processes: frozenset[str] = self.node.others(topic)
        return processes

    def lost(self, topic: str) -> frozenset[str]:
        """Return programs that the master lists still, half a second ago at most, and that are not connected."""
        listed: frozenset[str] = self.node.listed.get(topic, frozenset())
        return listed.difference(self.connections(topic).publishers)

    def is_up(self) -> bool:
        """Return True if it is open and the master answered when last asked, half a second ago at most."""
        return self.node.up and not self.inbox.closed

    def close(self) -> None:
        """End all topics and services; the node itself, without topics, lives as long as the process."""
        global _open
        was_shut_down = self.inbox.closed
        super().close()
        if _open is not self:
            return
        _open = None
        self.node.on_shutdown = lambda: None
        if was_shut_down:
            return  # rospy has ended everything
        self._end_topics()
        self.node.end_services()
