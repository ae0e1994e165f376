"""Mimic joints: those that follow others (URDF's <mimic>, MJCF's equalities), in terms of joints that are free."""

from collections.abc import Mapping
from typing import NamedTuple

from catenary.errors import UnsupportedModelError


class Mimic(NamedTuple):
    """A joint's position is multiplier * (the leader's position) + offset; a constant without a leader."""

    leader: str | None
    multiplier: float
    offset: float  # [rad or m]


def resolve_mimics(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Express each following joint, q = multiplier * q_leader + offset, by one that is free: not among them."""
    resolved: dict[str, Mimic] = {}
    for joint, first in mimics.items():
        chain = [joint]
        here = first
        while here.leader is not None and here.leader in mimics:
            if here.leader in chain:
                raise UnsupportedModelError(
                    f'joint "{joint}" follows itself: {" -> ".join([*chain, here.leader])}; '
                    "expected a chain of mimic joints that ends at one that is free"
                )
            chain.append(here.leader)
            then = mimics[here.leader]
            here = Mimic(then.leader, here.multiplier * then.multiplier, here.multiplier * then.offset + here.offset)
        resolved[joint] = here
    return resolved
