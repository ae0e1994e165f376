"""The frames of a sheet, each on a topic of its own, sent together."""

from collections.abc import Sequence
from typing import Protocol

from catenary.crtk.sheet import HEARD, Sheet


class FramePublisher(Protocol):
    """What sends frames of one topic."""

    def publish_frame(self, frame: bytearray | memoryview) -> None:
        """Send a frame."""
        ...


class Bundle:
    """Sends frames one after the other; a transport may have a quicker way.

    From the beginning of a bundle on, nothing else publishes on its topics.
    """

    def __init__(self, publishers: Sequence[FramePublisher], sheet: Sheet) -> None:
        """Send a sheet's frames, each by its publisher."""
        self._publishers, self._sheet = publishers, sheet

    def send(self) -> None:
        """Send the frames that are marked as heard.

        Raises:
            TransportError: The transport is closed.
        """
        for topic, publisher in enumerate(self._publishers):
            if self._sheet.topics[topic, HEARD]:
                publisher.publish_frame(self._sheet.frame(topic))
