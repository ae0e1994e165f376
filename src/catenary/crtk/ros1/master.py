"""ROS 1's master, asked over XML-RPC with a limit on the time; needs nothing of ROS.

The master only brings programs together: topics that are connected go on without it.
API: wiki.ros.org/ROS/Master_API.
"""

import http.client
import os
import socket
import threading
import xmlrpc.client
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import urlparse

from catenary.errors import TransportError

_DEFAULT_URI = "http://localhost:11311"
_ANSWER_WITHIN_S = 2.0  # [s] for an answer


class Refused(Exception):
    """The master, or a node, answered that it cannot."""


class _LimitedTransport(xmlrpc.client.Transport):
    """XML-RPC that does not wait for ever."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Return a connection with a time limit, whatever the process's default is."""
        connection = super().make_connection(host)
        connection.timeout = _ANSWER_WITHIN_S
        return connection


class Master:
    """Questions to a master, each answered within `_ANSWER_WITHIN_S`, or TransportError is raised."""

    def __init__(self, uri: str, caller: str) -> None:
        """Prepare without a call to the master."""
        parts = urlparse(uri)
        try:
            valid = parts.scheme == "http" and bool(parts.hostname) and parts.port is not None
        except ValueError:
            valid = False
        if not valid:
            raise TransportError(f'ROS_MASTER_URI "{uri}": expected http://HOST:PORT, such as {_DEFAULT_URI}')
        self.uri = uri
        self._caller = caller

    def pid(self) -> int:
        """Process number, which distinguishes a restarted master from the one before."""
        return int(self.ask(self.uri, "getPid"))

    def node(self, name: str) -> str | None:
        """URI of a node that the master knows, or None."""
        return self._lookup("lookupNode", name)

    def node_answers(self, uri: str, topic: str | None = None) -> bool:
        """Return True if a node is alive and publishes a topic: another may have the port of one that crashed."""
        try:
            published = self.ask(uri, "getPublications")
        except (TransportError, Refused):
            return False
        return topic is None or topic in dict(published)

    def service_answers(self, name: str) -> bool:
        """Return True if a living program offers a service."""
        parts = urlparse(self._lookup("lookupService", name) or "")
        if parts.hostname is None:
            return False
        try:
            with socket.create_connection((parts.hostname, parts.port), _ANSWER_WITHIN_S):
                return True
        except OSError:
            return False

    def living(self, topic: str, names: Iterable[str]) -> dict[str, str]:
        """Return those nodes among `names` that are alive and publish a topic, with their URIs."""
        uris = {name: self.node(name) for name in sorted(names)}
        return {name: uri for name, uri in uris.items() if uri is not None and self.node_answers(uri, topic)}

    def publisher_names(self) -> dict[str, frozenset[str]]:
        """Nodes that publish each topic, whether they answer or not."""
        published, _, _ = self.ask(self.uri, "getSystemState")
        return {str(topic): frozenset(map(str, nodes)) for topic, nodes in published}

    def publishing(self) -> dict[str, frozenset[str]]:
        """As `publisher_names`, each with a space and its URI behind its name."""
        publishers = self.publisher_names()
        whole = {name: f"{name} {self.node(name) or ''}" for names in publishers.values() for name in names}
        return {topic: frozenset(whole[name] for name in names) for topic, names in publishers.items()}

    def topics(self) -> dict[str, str]:
        """Topics that somebody publishes, and their types as the publisher spells them."""
        return {str(topic): str(kind) for topic, kind in self.ask(self.uri, "getPublishedTopics", "")}

    def _lookup(self, method: str, name: str) -> str | None:
        try:
            return str(self.ask(self.uri, method, name))
        except Refused:
            return None

    def ask(self, uri: str, method: str, *arguments: Any) -> Any:
        """Ask the master, or a node, in a thread of its own: looking up a host's address knows no time limit."""
        answer: list[Any] = []

        def ask() -> None:
            try:
                with xmlrpc.client.ServerProxy(uri, transport=_LimitedTransport()) as server:
                    answer.append(getattr(server, method)(self._caller, *arguments))
            except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
                answer.append(error)

        thread = threading.Thread(target=ask, daemon=True)
        thread.start()
        thread.join(_ANSWER_WITHIN_S + 0.5)
        result = answer[0] if answer else TimeoutError("no answer")
        if isinstance(result, Exception):
            if uri != self.uri:
                raise TransportError(f"node at {uri} does not answer: {result}") from result
            raise TransportError(
                f"no ROS master at {uri} ({result}). Start one with roscore, or set ROS_MASTER_URI to that of the "
                "robot, and ROS_IP to this machine's address as the robot sees it"
            ) from result
        code, text, value = result
        if code != 1:
            raise Refused(f"{method}: {text}")
        return value


def bound_to_all(environment: Mapping[str, str]) -> str | None:
    """Return the warning of a node that listens on all addresses; None on loopback [rosgraph.network]."""
    name = next((environment[key] for key in ("ROS_HOSTNAME", "ROS_IP") if environment.get(key)), "")
    if name == "localhost" or name.startswith("127.") or name == "::1":
        return None
    reason = f"only says what others call it ({name})" if name else "ROS_IP and ROS_HOSTNAME are not set"
    return (
        f"this ROS 1 node listens on all addresses of this machine: {reason}, and ROS 1 has no authentication; "
        "ROS_IP=127.0.0.1 restricts it to this machine"
    )


def master_uri(uri: str | None = None) -> str:
    """URI of the master: the one given, else ROS_MASTER_URI, else this machine's."""
    return uri or os.environ.get("ROS_MASTER_URI") or _DEFAULT_URI
