import importlib.util
import os
import sys
from pathlib import Path

import pytest

from catenary.crtk.network import RosArguments, make_transport, node_name, parse_ros_arguments, split_ros_arguments
from catenary.crtk.ros1 import transport as find_rospy
from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.errors import InputError, MissingPackageError


def test_ros_2_without_its_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    for name in [name for name in sys.modules if name.startswith(("cyclonedds", "catenary.crtk.dds"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cyclonedds", None)
    with pytest.raises(MissingPackageError, match="pip install 'cyclonedds"):
        make_transport("2", "one")


def test_another_network_is_refused():
    with pytest.raises(InputError, match='ros "3": expected 1, 2 or none'):
        make_transport("3", "one")


def test_names_are_unique_unless_one_is_chosen():
    assert node_name("monitor") == f"catenary_monitor_{os.getpid()}"
    assert node_name("gravity-node") == f"catenary_gravity_node_{os.getpid()}"
    assert node_name("monitor", "/wall") == "wall"


def test_a_name_that_no_node_can_have_is_refused():
    with pytest.raises(InputError, match='--name "1 2"'):
        node_name("monitor", "1 2")


@pytest.fixture
def without_rospy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A system without rospy; the folder where Debian would have it."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(find_rospy, "_FOLDERS", (tmp_path,))
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


def test_a_system_without_rospy_is_told_how_to_get_it(without_rospy: Path) -> None:
    with pytest.raises(MissingPackageError, match=r"apt install python3-rospy.*loopback"):
        make_rospy_importable()


@pytest.mark.parametrize("fits", [True, False])
def test_the_systems_packages_come_last_where_versions_agree(without_rospy, monkeypatch, fits) -> None:
    (without_rospy / "rospy").mkdir()
    (without_rospy / "rospy" / "__init__.py").touch()
    before = list(sys.path)
    monkeypatch.setattr(find_rospy, "_system_python", lambda: sys.version_info[:2] if fits else (3, 8))
    if fits:
        make_rospy_importable()
        assert sys.path == [*before, str(without_rospy)]
    else:
        with pytest.raises(MissingPackageError, match="not found for Python"):
            make_rospy_importable()


def test_arguments_of_ros_end_at_two_dashes_or_with_the_line() -> None:
    words = ["--ros", "2", "--ros-args", "-r", "a:=b", "--", "--json", "--ros-args", "-r", "c:=d"]
    assert split_ros_arguments(words) == (["--ros", "2", "--json"], ["-r", "a:=b", "-r", "c:=d"])


def test_rules_name_topics_the_node_and_its_namespace() -> None:
    found = parse_ros_arguments(["-r", "/arm1/move_jp:=/PSM1/move_jp", "--remap", "a:=b", "-r", "__ns:=/lab/left"])
    assert found == RosArguments({"/arm1/move_jp": "/PSM1/move_jp", "/a": "/b"}, None, "/lab/left")
    assert parse_ros_arguments(["-r", "__node:=one", "-r", "__name:=two", "-r", "__ns:=/"]).node == "two"


def test_names_are_translated_both_ways_and_those_that_were_given_away_mean_nothing() -> None:
    arguments = RosArguments({"/a": "/b"})
    assert (arguments.network_name("/a"), arguments.network_name("/c")) == ("/b", "/c")
    assert (arguments.own_name("/b"), arguments.own_name("/c"), arguments.own_name("/a")) == ("/a", "/c", None)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["-p", "use_sim_time:=true"], "-p: expected -r FROM:=TO"),
        (["--log-level", "debug"], "--log-level"),
        (["-r"], 'expected FROM:=TO of topics'),
        (["-r", "a=b"], 'expected FROM:=TO of topics'),
        (["-r", "a b:=c"], 'expected FROM:=TO of topics'),
        (["-r", "__ns:=lab"], 'expected FROM:=TO of topics'),
        (["-r", "__ns:=/a//b"], 'expected FROM:=TO of topics'),
        (["-r", "__node:=a/b"], 'expected FROM:=TO of topics'),
        (["-r", "__other:=a"], 'expected FROM:=TO of topics'),
        (["-r", "a:=c", "-r", "b:=c"], "two names become /c"),
    ],
)  # fmt: skip
def test_anything_else_is_refused(words: list[str], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        parse_ros_arguments(words)
