import os

import pytest

from catenary.crtk.node_name import node_name
from catenary.errors import InputError


def test_names_are_unique_unless_one_is_chosen():
    assert node_name("monitor") == f"catenary_monitor_{os.getpid()}"
    assert node_name("gravity-node") == f"catenary_gravity_node_{os.getpid()}"
    assert node_name("monitor", "/wall") == "wall"


def test_a_name_that_no_node_can_have_is_refused():
    with pytest.raises(InputError, match='--name "1 2"'):
        node_name("monitor", "1 2")
