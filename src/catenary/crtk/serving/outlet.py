"""What a server publishes: nothing is sent on topics that nobody listens to."""

from catenary.crtk.names import CrtkTopic
from catenary.crtk.transport import Transport


class Outlet:
    """A topic that a server publishes, while somebody listens."""

    def __init__(self, transport: Transport, topic: CrtkTopic) -> None:
        """Begin to publish."""
        self._transport = transport
        self.topic = topic
        self._latched = topic.verb == "operating_state"  # whoever comes later knows it at once
        self.publisher = transport.publisher(topic.name, topic.type, latch=self._latched)
        self.publish = self.publisher.publish
        self.heard = True
        self.due = (
            True  # whether the last message, which a latched topic gives to newcomers, is to be a new one
        )

    def watch(self) -> None:
        """Look whether anybody listens; called some ten times a second."""
        self.heard = bool(self._transport.connections(self.topic.name).subscribers)
        self.due = self._latched
