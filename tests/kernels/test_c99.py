"""A line of operations as C, by the compilers that there are."""

from dataclasses import replace

import pytest

from catenary.kernels.c99 import c_name
from catenary.robots.catalog import load_robot


@pytest.mark.parametrize(
    ("text", "name"), [("raven2", "raven2"), ("Panda (left)", "panda_left"), ("2 link", "robot_2_link"), ("", "robot")]
)
def test_names_become_names_of_c(text: str, name: str) -> None:
    assert c_name(text) == name
    assert replace(load_robot("raven2"), name=text).name == text
