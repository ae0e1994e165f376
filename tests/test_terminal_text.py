"""No control character of a name reaches a terminal."""

import io
import json

import numpy as np
import pytest

from catenary.monitor import Snapshot, monitor_lines
from catenary.terminal_text import VisibleStream, visible
from command_line import catenary

EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\r\u202e\u2028\x7f"


def test_control_characters_are_written_out_and_all_else_stays():
    assert visible("a\tb\né 力 🙂") == "a\tb\né 力 🙂"
    assert visible("\x1b[2J\u202e") == "\\u001b[2J\\u202e"
    assert json.loads(visible(json.dumps({"name": "a\x7f"}, ensure_ascii=False))) == {"name": "a\x7f"}


def test_a_stream_passes_on_what_it_does_not_write():
    stream = VisibleStream(io.StringIO())
    assert stream.write("a\x1b") == 2
    stream.writelines(["\r", "b"])
    assert not stream.isatty()
    assert stream.getvalue() == "a\\u001b\\u000db"


@pytest.mark.parametrize(
    "words", [("fk", EVIL), ("check", EVIL), (EVIL,), ("robots", f"--{EVIL}"), ("fk", "raven2", "--q", EVIL)]
)
def test_a_refusal_shows_a_name_without_its_control_characters(words):
    outcome = catenary(*words)
    assert outcome.code == 2
    assert "1b" in outcome.err
    assert visible(outcome.out + outcome.err) == outcome.out + outcome.err


def test_a_joint_of_a_recording_cannot_draw_on_the_terminal(tmp_path):
    log = tmp_path / "log.npz"
    rows = np.linspace(0.0, 1.0, 50)[:, None]
    np.savez(
        log,
        q_des=rows,
        q_act=rows,
        ok=np.ones(50, dtype=bool),
        t=rows[:, 0],
        units=np.array(["rad"]),
        joint_names=np.array([f"J{EVIL}"]),
    )
    outcome = catenary("check", log)
    assert "1b" in outcome.out + outcome.err
    assert visible(outcome.out + outcome.err) == outcome.out + outcome.err


def test_an_error_is_not_as_long_as_the_name_in_it():
    outcome = catenary("fk", "a" * 100_000)
    assert outcome.code == 2
    assert len(outcome.err) < 11_000


def test_the_screen_shows_names_without_control_characters():
    q = np.zeros(1)
    shot = Snapshot(1.0, (EVIL,), ("rad",), q, silent=EVIL)
    lines = monitor_lines(f"arm{EVIL}\n", shot, 200, 24)
    assert [line for line in lines if visible(line) != line or "\n" in line] == []
