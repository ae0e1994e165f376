from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from oracles.cyclone_peer import CyclonePeer


@pytest.fixture
def robot(dds_domain: int) -> Iterator[Any]:
    """A transport."""
    from catenary.crtk.dds.transport import DdsTransport

    with DdsTransport("robot", settle=0.05) as transport:
        yield transport


@pytest.fixture
def peer(dds_domain: int) -> "CyclonePeer":
    """A program that is not ours."""
    from oracles.cyclone_peer import CyclonePeer

    return CyclonePeer(dds_domain)
