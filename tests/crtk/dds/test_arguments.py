import pytest

from catenary.crtk.dds.arguments import RosArguments, parse_ros_arguments, split_ros_arguments
from catenary.errors import InputError


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
