import sys

import pytest

from catenary.crtk.loopback import Loopback
from catenary.crtk.network import make_transport
from catenary.errors import InputError, MissingPackageError


def test_none_is_a_loopback_of_ones_own():
    with make_transport("none", "one") as transport, make_transport("none", "one") as other:
        assert isinstance(transport, Loopback)
        assert transport.network is not other.network


def test_ros_2_without_its_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    for name in [name for name in sys.modules if name.startswith(("cyclonedds", "catenary.crtk.dds"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    with pytest.raises(MissingPackageError, match=r'pip install "catenary\[ros2\]"'):
        make_transport("2", "one")


def test_another_network_is_refused():
    with pytest.raises(InputError, match='ros "3": expected 1, 2 or none'):
        make_transport("3", "one")
