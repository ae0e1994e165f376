import pytest

from catenary.crtk.loopback import Loopback
from catenary.crtk.network import make_transport
from catenary.errors import InputError


def test_none_is_a_loopback_of_ones_own():
    with make_transport("none", "one") as transport, make_transport("none", "one") as other:
        assert isinstance(transport, Loopback)
        assert transport.network is not other.network


def test_another_network_is_refused():
    with pytest.raises(InputError, match='ros "3": expected 1, 2 or none'):
        make_transport("3", "one")
