"""Two network namespaces with a cable between them, which can be cut; skips, saying so, where that is not allowed."""

import os
import random
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from dds import ROOT, VARIABLES, require_dds

ROBOT, CLIENT = "10.211.77.1", "10.211.77.2"
# puts a program into a namespace before it does anything else
ENTER = (
    "import ctypes, os, sys\n"
    "assert ctypes.CDLL(None).setns(os.open('/var/run/netns/' + os.environ['NAMESPACE'], os.O_RDONLY), 0x40000000) == 0\n"
)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Side:
    """One end of the cable: programs there find those of the other by their addresses."""

    def __init__(self, namespace: str, device: str, address: str) -> None:
        self.namespace, self._device = namespace, device
        kept = {name: value for name, value in os.environ.items() if name not in VARIABLES}
        self.environment = {
            **kept,
            "NAMESPACE": namespace,
            "ROS_DOMAIN_ID": "1",  # of a network of its own
            "CYCLONEDDS_URI": (
                f'<General><Interfaces><NetworkInterface address="{address}"/></Interfaces>'
                "<AllowMulticast>false</AllowMulticast></General>,<Discovery><Peers>"
                f'<Peer address="{ROBOT}"/><Peer address="{CLIENT}"/></Peers></Discovery>'
            ),
            "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")]),
        }

    def set(self, state: str) -> None:
        """Take the interface up or down."""
        _ip("-n", self.namespace, "link", "set", self._device, state)


@contextmanager
def cable() -> Iterator[tuple[Side, Side]]:
    """The robot's side and the client's, connected."""
    require_dds()
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and `ip`: apt install iproute2")
    number = random.SystemRandom().randrange(16**5)
    names = [f"ct{number:05x}{side}" for side in "ab"]
    try:
        try:
            for name in names:
                _ip("netns", "add", name)
            _ip("link", "add", names[0], "netns", names[0], "type", "veth", "peer", "name", names[1], "netns", names[1])
        except subprocess.CalledProcessError as error:
            pytest.skip(f"network namespaces are not allowed here: {error.stderr.decode().strip()}")
        for name, address in zip(names, (ROBOT, CLIENT), strict=True):
            _ip("-n", name, "address", "add", f"{address}/24", "dev", name)
            for device in ("lo", name):
                _ip("-n", name, "link", "set", device, "up")
        robot, client = (Side(name, name, place) for name, place in zip(names, (ROBOT, CLIENT), strict=True))
        yield robot, client
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)
