import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_line import catenary, refusal
from oracles.simulated_board import SimulatedBoard
from oracles.simulated_encoders import SimulatedEncoders


@contextmanager
def speaking(board: SimulatedEncoders) -> Iterator[None]:
    """The board sends the same counts at 100 Hz."""
    ending = threading.Event()

    def run() -> None:
        while not ending.wait(0.01):
            board.send([6366, 17825, 76000])

    thread = threading.Thread(target=run)
    thread.start()
    yield
    ending.set()
    thread.join()
    board.close()


def test_encoders_that_are_not_registered_say_so(tmp_path: Path):
    board = SimulatedEncoders(tmp_path / "board")
    with speaking(board):
        outcome = catenary("encoders", "--port", board.link, "--ros", "none", "--duration", "1.3")
    assert outcome.code == 1
    assert "6366 17825 76000 counts" in outcome.out
    assert "not registered: home the robot" in outcome.out


def test_encoders_print_json_lines(tmp_path: Path):
    board = SimulatedEncoders(tmp_path / "board")
    with speaking(board):
        outcome = catenary("encoders", "--port", board.link, "--ros", "none", "--duration", "1.3", "--json")
    *each, last = [json.loads(line) for line in outcome.out.splitlines()]
    assert len(each) == 1
    final = last["final"]
    assert final["counts"] == [6366, 17825, 76000]
    assert final["q_encoder"] == [None] * 3
    assert final["line"]["malformed"] == 0
    assert final["published"]["/joint_enc"] > 50
    assert final["published"]["/ext_jpos"] == 0


def test_gravity_is_published_from_a_board(tmp_path: Path):
    board = SimulatedBoard(tmp_path / "board", gyroscope=False)
    board.speak(lambda t: (0.0, 0.0, 9.81 + 0.001 * (round(100 * t) % 7)))
    time.sleep(0.1)
    outcome = catenary("gravity-node", "--port", board.link, "--ros", "none", "--duration", "1.5", "--json")
    board.close()
    assert outcome.code == 0
    final = json.loads(outcome.out.splitlines()[-1])["final"]
    assert final["gravity"] == pytest.approx([0.0, 0.0, -9.81], abs=0.05)
    assert final["status"] == "live"
    assert final["published"] > 50
    assert final["link"]["samples"] > 50


def test_a_topic_on_which_nothing_comes_is_told():
    outcome = catenary("gravity-node", "--imu", "/imu/data_raw", "--ros", "none", "--duration", "0.5")
    assert outcome.code == 1
    assert "nominal" in outcome.out
    assert "nothing_received" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("encoders", "--port", "/none", "--ros", "none"), "/none: cannot be opened"),
        (("encoders", "--port", "/none", "--ros", "3"), 'ros "3": expected 1, 2 or none'),
        (("encoders", "--port", "/none", "--bits", "12", "--ros", "none"), "bits: expected one of"),
        (("encoders", "--port", "/none", "--direction", "1,2,1", "--ros", "none"), "expected 1 or -1"),
        (("gravity-node", "--ros", "none"), "one of --imu, --accel, --vector and --port"),
        (("gravity-node", "--imu", "/a", "--port", "/b"), "one of --imu, --accel, --vector and --port"),
        (("gravity-node", "--port", "/b", "--points-down"), "--points-down is of a topic"),
        (("gravity-node", "--imu", "/a", "--ros", "none", "--rate", "0"), "rate"),
        (("gravity-node", "--imu", "/a", "--ros", "none", "--fallback", "pray"), "fallback"),
        (("gravity-node", "--imu", "/a", "--mounting", "/none.toml"), "no such file"),
    ],
)
def test_wrong_options_are_refused(arguments, said):
    assert said in refusal(*arguments)
