"""What a server publishes, quickly: nothing is sent on topics that nobody listens to."""

from collections.abc import Callable

from catenary.crtk.frames import STAMP
from catenary.crtk.message import Message
from catenary.crtk.names import CrtkTopic
from catenary.crtk.transport import Transport


class Outlet:
    """A topic that a server publishes, while somebody listens."""

    __slots__ = ("_publish_frame", "_transport", "heard", "publish", "publisher", "topic")

    def __init__(self, transport: Transport, topic: CrtkTopic) -> None:
        """Begin to publish.

        Raises:
            TransportError: The topic carries another type, or is published already.
        """
        self._transport = transport
        self.topic = topic
        latch = topic.verb == "operating_state"  # whoever comes later knows it at once
        self.publisher = transport.publisher(topic.name, topic.type, latch=latch)
        self.publish: Callable[[Message], None] = self.publisher.publish
        self._publish_frame = self.publisher.publish_frame
        self.heard = True

    def send(self, frame: bytearray, stamp: bytes) -> None:
        """Publish a frame, stamped."""
        frame[STAMP] = stamp
        self._publish_frame(frame)

    def watch(self) -> None:
        """Look whether anybody listens; called some ten times a second."""
        self.heard = bool(self._transport.connections(self.topic.name).subscribers)
