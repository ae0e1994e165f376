"""A node that publishes at a rate, and says each second how it goes, until somebody ends it."""

from collections.abc import Callable
from typing import Any, Protocol

from catenary.crtk.clock import SECOND
from catenary.crtk.transport import Transport
from catenary.errors import InputError


class PublishingNode(Protocol):
    """What is published by: a step at a time, and what it says of itself."""

    transport: Transport

    def step(self) -> Any:
        """Publish what there is."""

    def status(self, seconds: float) -> Any:
        """Return the status, `seconds` after the begin."""


def publish(
    node: PublishingNode,
    *,
    rate_hz: float,
    duration: float | None = None,
    show: Callable[[Any], None] = lambda status: None,
) -> Any:
    """Step a node at a rate until the duration [s] is over, its transport closed, or Ctrl-C; return the last status.

    `show` gets a status every second.
    """
    if duration is not None and not duration > 0.0:
        raise InputError(f"duration: expected more than 0 s, got {duration}")
    transport = node.transport
    rate = transport.rate(rate_hz)
    begin = shown = now = transport.steady()
    try:
        node.step()
        while duration is None or now - begin < duration * SECOND:
            rate.sleep()
            node.step()
            now = transport.steady()
            if now - shown >= SECOND:
                shown = now
                show(node.status((now - begin) / SECOND))
    except KeyboardInterrupt:
        pass  # somebody ended it
    return node.status((now - begin) / SECOND)
