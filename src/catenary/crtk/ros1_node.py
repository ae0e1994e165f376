"""The one rospy node that a process can have: started, watched, registered again when the master comes back.

Imports rospy, so it is imported only when a `Ros1Transport` is made. rospy keeps its state in module globals: a process
has one node with one name until it ends. Its signal handlers are not installed and it writes no log files; its loggers
(`rospy`, `rosout`) are the program's.
"""

import atexit
import logging
import os
import threading
from collections.abc import Callable
from typing import Any

import rospy
from rospy.impl.registration import get_registration_listeners, get_service_manager, get_topic_manager

from catenary.crtk.ros1_handshakes import take_in_threads
from catenary.crtk.ros1_master import Master, Refused
from catenary.errors import TransportError

WATCH = 0.5  # [s] between looks at the master
_logger = logging.getLogger(__name__)
_node: "Node | None" = None


class Node:
    """This process's node, and what it knows of its master."""

    def __init__(self, name: str, uri: str) -> None:
        """Start it; see `node`."""
        caller = f"{os.environ.get('ROS_NAMESPACE', '').rstrip('/')}/{name}"
        self.name = caller if caller.startswith("/") else f"/{caller}"
        self.master = Master(uri, self.name)
        self.master_pid = self.master.pid()
        other = self.master.node(self.name)
        if other is not None and self.master.node_answers(other):
            raise TransportError(
                f"a node {self.name} runs already, at {other}; ROS would end it for one of the same name. "
                "Choose another name, or end that one first"
            )
        os.environ["ROS_MASTER_URI"] = uri  # rospy knows no other way, and asks again for services
        configure, rospy.core.configure_logging = rospy.core.configure_logging, lambda *_, **__: None
        try:
            # no arguments of the program, whose names could otherwise be remapped
            rospy.init_node(name, argv=[], disable_signals=True, disable_rosout=True, disable_rostime=True)
        finally:
            rospy.core.configure_logging = configure
        take_in_threads()
        self.uri: str = rospy.core.get_node_uri()
        self.up = True
        self.registered_again = 0
        self._missing: set[tuple[str, str]] = set()  # topics, and publishers that were not connected
        self.on_shutdown: Callable[[], None] = lambda: None
        rospy.core.add_client_shutdown_hook(lambda: self.on_shutdown())
        atexit.register(rospy.signal_shutdown, "the program ends")
        threading.Thread(target=self._watch, name="ROS master watch", daemon=True).start()

    def _watch(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._look()
            except (TransportError, Refused) as error:
                if self.up:
                    _logger.warning("%s; topics that are connected go on", error)
                self.up = False
            threading.Event().wait(WATCH)

    def _look(self) -> None:
        """Register again with a master that is another process, or that has forgotten this node."""
        pid, known = self.master.pid(), self.master.node(self.name)
        if rospy.is_shutdown():
            return  # it is being unregistered, and unknown for that
        if pid != self.master_pid or known is None:
            self._register()
            self.master_pid = pid
            self.registered_again += 1
            _logger.warning("registered again with the ROS master at %s", self.master.uri)
        self.up = True
        self._mend()

    def _mend(self) -> None:
        """Connect again to publishers whose connections broke while they lived on; rospy alone gives them up."""
        listed = self.master.publisher_names()
        missing = {
            (topic, name)
            for topic, received in list(get_topic_manager().subs.items())
            for name in listed.get(topic, frozenset()) - _connected(received)
        }
        # missing at two looks: one that has only just come is being connected
        for topic, name in missing & self._missing:
            uri = self.master.node(name)
            # an answer first: rospy would wait for it for a minute, and connect twice when asked again
            if uri is not None and self.master.node_answers(uri):
                for listener in get_registration_listeners().listeners:
                    listener.publisher_update(topic, [uri])
        self._missing = missing

    def _register(self) -> None:
        topics, register = get_topic_manager(), self.master.register
        for topic, kind in topics.get_publications():
            register("registerPublisher", topic, kind, self.uri)
        for topic, kind in topics.get_subscriptions():
            publishers = register("registerSubscriber", topic, kind, self.uri)
            for listener in get_registration_listeners().listeners:
                listener.publisher_update(topic, publishers)
        for name, service_uri in get_service_manager().get_services():
            register("registerService", name, service_uri, self.uri)


def _connected(received: Any) -> frozenset[str]:
    """Names of the publishers that a subscription is connected to."""
    return frozenset(getattr(one, "callerid_pub", None) or "" for one in list(received.connections or ()))


def node(name: str, uri: str) -> Node:
    """Give this process's node; it is started once.

    Raises:
        TransportError: There is no master, the name is taken, or the process has a node of another name or master, or
            one that was shut down.
    """
    global _node
    if _node is None:
        if rospy.core.is_initialized():
            raise TransportError(
                f"this process called rospy.init_node as {rospy.get_name()} itself; leave that to catenary"
            )
        _node = Node(name, uri)
    if rospy.is_shutdown():
        raise TransportError("the ROS node of this process was shut down, and rospy cannot start another")
    if _node.name.rpartition("/")[2] != name or _node.master.uri != uri:
        raise TransportError(
            f"this process is ROS node {_node.name} of {_node.master.uri} until it ends, and cannot be {name} of {uri}"
        )
    return _node
