"""A DDS domain of the tests' own on this machine alone; skips, saying so, where the cyclonedds package is missing."""

import os
import random
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# programs find each other on the loopback interface alone, without multicast, which a sandbox may lack
LOOPBACK = (
    '<General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General>,'
    '<Discovery><Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
)
NODE = "catenary_test"
VARIABLES = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "ROS_DISTRO")


def require_dds() -> None:
    """Skip where DDS is missing."""
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install cyclonedds")


def free_domain() -> int:
    """A domain that nobody on this machine is in: no program has its first port."""
    while True:
        domain = random.SystemRandom().randint(1, 100)  # beyond, ports are those that the system gives to anybody
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", 7410 + 250 * domain))
            except OSError:
                continue
        return domain


def environment(domain: int) -> dict[str, str]:
    """Variables of a program in the domain."""
    kept = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return {**kept, "CYCLONEDDS_URI": LOOPBACK, "ROS_DOMAIN_ID": str(domain)}


class Network:
    """A domain for programs beside the tests, as `ros.Master` is one for ROS 1's."""

    def __init__(self, domain: int | None = None) -> None:
        require_dds()
        self.domain = free_domain() if domain is None else domain
        self.environment = {
            **environment(self.domain),
            "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")]),
        }


@contextmanager
def dds_domain() -> Iterator[int]:
    """A domain for this process and its children."""
    require_dds()
    domain = free_domain()
    with pytest.MonkeyPatch.context() as patch:
        for name in VARIABLES:
            patch.delenv(name, raising=False)
        for name, value in environment(domain).items():
            patch.setenv(name, value)
        yield domain
