import io
import math
import sys

import pytest

from catenary.cli.terminal import print_json, print_notes, print_result, progress_bar


def test_what_json_does_not_know_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"a": [math.nan, math.inf, -math.inf, 1.5, True, None, "µ"], "b": (1,)})
    shown = "".join(capsys.readouterr().out.split())
    assert shown == '{"a":[null,null,null,1.5,true,null,"\\u00b5"],"b":[1]}'


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_long_facts_fill_the_lines_of_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    shown = Terminal()
    monkeypatch.setattr(sys, "stdout", shown)
    print_result(False, {}, [("sources", 10 * "seven77 "), ("verdicts", "")])
    lines = shown.getvalue().split("\n")
    assert max(map(len, lines)) <= 40
    assert lines[1].startswith(" " * 12 + "seven77")


def test_a_pipe_gets_facts_on_one_line_and_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    print_result(False, {}, [("sources", 30 * "word ")])
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
