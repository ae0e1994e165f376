"""Who cannot hear whom over a topic, said once, with both names: DDS itself says nothing."""

import logging
import time
from collections.abc import Iterator, Mapping

from catenary.crtk.dds.directory import Directory, Endpoint
from catenary.crtk.dds.names import dds_type, ros_topic, ros_type
from catenary.crtk.dds.qualities import Quality

_PATIENCE = 1.0  # [s] until a program without a ROS node is called by its number
_logger = logging.getLogger(__name__)
Ours = Mapping[str, tuple[str, Quality]]  # type and quality, by DDS's names of topics


class Mismatches:
    """Compares the ends of this program's topics with those of others."""

    def __init__(self, directory: Directory, own: bytes, node: str) -> None:
        """Prepare; `own` is this program's number."""
        self._directory, self._own, self._node = directory, own, node
        self._said: set[bytes] = set()  # ends by their numbers
        self._seen: dict[bytes, float] = {}  # when, of those whose node is not known yet
        self._changes = -1

    @property
    def is_due(self) -> bool:
        """Return whether others have come since the last look, or wait to be named."""
        return self._changes != self._directory.changes or bool(self._seen)

    def look(self, published: Ours, heard: Ours) -> None:
        """Warn of those that have come; called where that is due."""
        self._changes = self._directory.changes
        for dds_name, (kind, quality) in published.items():
            topic = ros_topic(dds_name)
            for end in self._others(self._directory.subscribers(dds_name)):
                if end.type_name != dds_type(kind):
                    self._say(
                        end, f"{topic}: {{}} takes {ros_type(end.type_name)}, {self._node} publishes {kind}"
                    )
                elif missing := quality.lacks(end.quality):
                    asked = f"it asks for {end.quality}, offered is {quality} ({', '.join(missing)})"
                    self._say(end, f"{topic}: {{}} hears nothing of {self._node}: {asked}")
        for dds_name, (kind, quality) in heard.items():
            topic = ros_topic(dds_name)
            for end in self._others(self._directory.publishers(dds_name)):
                if end.type_name != dds_type(kind):
                    self._say(
                        end, f"{topic}: {{}} publishes {ros_type(end.type_name)}, {self._node} takes {kind}"
                    )
                elif end.quality.is_plain is not quality.is_plain:
                    self._say(end, f"{topic}: {self._node} hears nothing of {{}}, which offers {end.quality}")

    def _others(self, ends: list[Endpoint]) -> Iterator[Endpoint]:
        return (end for end in ends if end.participant != self._own and end.guid not in self._said)

    def _say(self, end: Endpoint, text: str) -> None:
        since = self._seen.setdefault(end.guid, time.monotonic())
        if self._directory.is_named(end) or time.monotonic() > since + _PATIENCE:
            del self._seen[end.guid]
            self._said.add(end.guid)
            _logger.warning("topic %s", text.format(self._directory.node(end)))
