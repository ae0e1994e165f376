"""How an option is declared, read and refused."""

import io
import math
import shlex
import sys
from collections.abc import Callable, Sequence
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from catenary.cli.main import app
from catenary.cli.options import Numbers, argument, as_typed, group, option, require_one, words
from catenary.cli.terminal import print_notes, print_result, printing, progress_bar
from catenary.crtk import network
from catenary.crtk.loopback import Loopback
from catenary.crtk.network import RosArguments, said_ros_arguments, say_ros_arguments
from catenary.errors import InputError


@group
class Shared:
    """Options of several commands."""

    tilt: tuple[float, float] | None = option("R,P", "A pair of numbers.")
    ros: int | None = option("1|2", "Few choices.")
    topic: str = option(None, "Nothing without --ros.", "/imu", goes_with="ros")
    fast: bool = option(None, "Nothing beside --ros.", False, not_with="ros")


def asked(command: Callable[..., None], *typed: str) -> None:
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(as_typed(command))
    result = CliRunner().invoke(app, typed)
    if isinstance(result.exception, InputError):
        raise result.exception
    if result.exit_code:
        raise typer.BadParameter(" ".join(result.output.replace("\u2502", " ").split()))


def given(*typed: str) -> dict[str, Any]:
    """What a command gets of what is typed."""
    seen: dict[str, Any] = {}

    def command(
        shared: Shared,
        files: Sequence[str] = argument("FILE", "Any.", None),
        box: Sequence[tuple[float, float]] = option("X,Y", "Repeatable."),
        q: Numbers = option("Q,Q,...", "As many as there are.", (1.0, 2.5)),
    ) -> None:
        seen.update(vars(shared), files=files, box=box, q=q)

    asked(command, *typed)
    return seen


def test_what_is_not_typed_has_its_default() -> None:
    assert given() == {
        "tilt": None, "ros": None, "topic": "/imu", "fast": False, "files": (), "box": (), "q": (1.0, 2.5),
    }  # fmt: skip


def test_a_type_says_how_a_text_is_read() -> None:
    typed = "a b --tilt 1,-2e1 --box '1 2' --box 3,4 --q ' 7, -2.5 ,3e-3, ' --ros 2 --topic /a"
    seen = given(*shlex.split(typed))
    assert seen == {
        "tilt": (1.0, -20.0), "ros": 2, "topic": "/a", "fast": False,
        "files": ("a", "b"), "box": ((1.0, 2.0), (3.0, 4.0)), "q": (7.0, -2.5, 3e-3),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "said"),
    {
        "--tilt 1": "expected 2 numbers separated by commas, got '1'",
        "--q 1,two": "got 'two' in '1,two'",
        "--q 1;2": "expected numbers separated by commas",
        "--q ,": "expected numbers separated by commas",
        "--ros 3": "--ros 3: expected 1 or 2",
        "--topic /a": "--topic: goes with --ros",
        "--fast --ros 1": "--fast: does not go with --ros",
    }.items(),
)
def test_what_cannot_be_meant_is_refused(typed: str, said: str) -> None:
    with pytest.raises((InputError, typer.BadParameter), match=said):
        given(*typed.split())


def test_one_of_several_must_be_given() -> None:
    require_one(q_deg=None, q=(1.0,), is_rest=False)
    for wrong in ({"q_deg": None, "q": None}, {"q_deg": 1, "q": 2}):
        with pytest.raises(InputError, match="give one of --q-deg and --q"):
            require_one(**wrong)


def test_words_stand_between_commas() -> None:
    assert words(" rad,, m ,") == ("rad", "m")


RUN = CliRunner()


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, RosArguments]]:
    """How networks are joined; in truth none is."""
    seen: list[tuple[str, RosArguments]] = []

    def join(ros: str, name: str) -> Loopback:
        seen.append((ros, said_ros_arguments()))
        return Loopback("program")

    monkeypatch.setattr(network, "make_transport", join)
    return seen


def test_a_distribution_and_names_reach_the_network(joined: list[tuple[str, RosArguments]]) -> None:
    words = "button --ros 2 --ros-distro humble --ros-args -r /silver_button:=/lab/button -r __ns:=/lab"
    RUN.invoke(app, words.split())
    assert joined == [("2", RosArguments({"/silver_button": "/lab/button"}, None, "/lab", "humble"))]
    RUN.invoke(app, ["button", "--ros", "2"])
    assert joined[1:] == [("2", RosArguments())]  # nothing is left of those before


def test_a_command_that_is_on_no_ros_takes_none_of_it() -> None:
    found = RUN.invoke(app, ["fit", "data.parquet", "--ros-args", "-r", "a:=b"])
    assert found.exit_code == 2
    assert "No such option" in found.output


@pytest.mark.parametrize("said", [RosArguments(distro="humble"), RosArguments({"/a": "/b"})])
def test_ros_1_and_none_refuse_what_is_for_ros_2(said: RosArguments) -> None:
    say_ros_arguments(said)
    try:
        for ros in ("1", "none"):
            with pytest.raises(InputError, match="go with ROS 2"):
                network.make_transport(ros, "one")
    finally:
        say_ros_arguments(RosArguments())


def test_what_json_does_not_know_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    with printing("json"):
        print_result({"a": [math.nan, math.inf, -math.inf, 1.5, True, None, "µ"], "b": (1,)})
    shown = "".join(capsys.readouterr().out.split())
    assert shown == '{"a":[null,null,null,1.5,true,null,"\\u00b5"],"b":[1]}'


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_long_facts_fill_the_lines_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    shown = Terminal()
    monkeypatch.setattr(sys, "stdout", shown)
    print_result({}, [("sources", 10 * "seven77 "), ("verdicts", "")])
    lines = shown.getvalue().split("\n")
    assert max(map(len, lines)) <= 40
    assert lines[1].startswith(" " * 12 + "seven77")


def test_a_pipe_gets_facts_on_one_line_and_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    print_result({}, [("sources", 30 * "word ")])
    assert capsys.readouterr().out.count("\n") == 1
    print_notes(["one", "two"])
    with progress_bar("fitting") as progress:
        progress(0.5)
    assert capsys.readouterr() == ("", "note: one\nnote: two\n")
