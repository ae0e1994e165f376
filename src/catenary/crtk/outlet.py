"""What a server publishes, quickly: nothing is sent on topics that nobody listens to."""

from collections.abc import Callable
from math import sqrt

from catenary.arrays import Floats
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


def quaternion(rotation: Floats) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a rotation matrix [Shepperd 1978]; in plain arithmetic, 20 times as quick as SciPy."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    largest = max(a + e + i, a, e, i)
    if largest == a + e + i:
        w = 0.5 * sqrt(1.0 + a + e + i)
        s = 0.25 / w
        return ((h - f) * s, (c - g) * s, (d - b) * s, w)
    if largest == a:
        x = 0.5 * sqrt(1.0 + a - e - i)
        s = 0.25 / x
        return (x, (b + d) * s, (c + g) * s, (h - f) * s)
    if largest == e:
        y = 0.5 * sqrt(1.0 - a + e - i)
        s = 0.25 / y
        return ((b + d) * s, y, (f + h) * s, (c - g) * s)
    z = 0.5 * sqrt(1.0 - a - e + i)
    s = 0.25 / z
    return ((c + g) * s, (f + h) * s, z, (d - b) * s)
