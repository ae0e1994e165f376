import io
import math
import sys

import pytest

from catenary.cli import terminal
from catenary.cli.terminal import numbers, print_fact, print_json, print_notes, print_table, progress_bar
from catenary.errors import InputError


@pytest.mark.parametrize("text", ["1,-2.5,3e-3", "1 -2.5 3e-3", " 1, -2.5 ,3e-3, "])
def test_numbers_stand_between_commas_or_spaces(text: str) -> None:
    assert numbers("--q", text) == numbers("--q", text, 3) == (1.0, -2.5, 3e-3)
    with pytest.raises(InputError, match="--q: expected 2 numbers separated by commas"):
        numbers("--q", text, 2)


@pytest.mark.parametrize("text", ["", " ", ",", "1,two", "1;2"])
def test_what_is_no_number_is_refused_by_the_options_name(text: str) -> None:
    with pytest.raises(InputError, match="--q: expected numbers separated by commas"):
        numbers("--q", text)


def test_words_stand_between_commas() -> None:
    assert terminal.words(" rad,, m ,") == ("rad", "m")


def test_what_json_does_not_know_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"a": [math.nan, math.inf, -math.inf, 1.5, True, None, "µ"], "b": (1,)})
    shown = "".join(capsys.readouterr().out.split())
    assert shown == '{"a":[null,null,null,1.5,true,null,"\\u00b5"],"b":[1]}'


def test_columns_of_a_table_line_up(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("Title", ["name", "J1 [deg]"], [["a", "1.0"], ["longer", "12.345"]])
    assert capsys.readouterr().out == (
        "Title\n\n"
        "  name        J1\n"
        "           [deg]\n"
        "  ------  ------\n"
        "  a          1.0\n"
        "  longer  12.345\n\n"
    )  # fmt: skip


def test_a_wide_table_is_not_cut_and_brackets_in_cells_do_no_harm(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    print_table("Title", [f"c{i}" for i in range(30)], [[f"{i}.123" for i in range(30)]])
    assert "29.123" in capsys.readouterr().out
    print_table("Title", ["name"], [["[red]a[/red] [rad]"], ["b\nc"]])
    assert capsys.readouterr().out.endswith("  [red]a[/red] [rad]\n  b c\n\n")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_long_facts_fill_the_lines_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    shown = Terminal()
    monkeypatch.setattr(sys, "stdout", shown)
    print_fact("sources", 10 * "seven77 ", width=8)
    lines = shown.getvalue().split("\n")
    assert max(map(len, lines)) <= 40
    assert lines[1].startswith(" " * 12 + "seven77")


def test_a_pipe_gets_facts_on_one_line_and_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    print_fact("sources", 30 * "word ", width=8)
    assert capsys.readouterr().out.count("\n") == 1
    print_notes(["one", "two"])
    with progress_bar("fitting") as progress:
        progress(0.5)
    assert capsys.readouterr() == ("", "note: one\nnote: two\n")


def test_a_progress_bar_in_a_terminal_says_what_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar("fitting") as progress:
        progress(0.5)
    assert "fitting" in shown.getvalue()
