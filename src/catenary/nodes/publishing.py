"""A node that publishes at a rate, and says each second how it goes, until somebody ends it."""

from collections.abc import Callable
from typing import Any

from catenary.crtk.clock import SECOND
from catenary.errors import InputError
from catenary.nodes.encoder_node import EncoderNode
from catenary.nodes.gravity_node import GravityNode


def publish(
    node: EncoderNode | GravityNode,
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
