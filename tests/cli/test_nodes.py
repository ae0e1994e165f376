import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.crtk import network
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from command_line import catenary
from oracles.manual_time import BoardTime
from oracles.simulated_board import SimulatedBoard
from oracles.simulated_encoders import SimulatedEncoders


@pytest.fixture
def encoders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatedEncoders]:
    """A board that sends the same counts at 100 Hz."""
    board = SimulatedEncoders(tmp_path / "board")
    time = BoardTime(board, lambda: board.line([6366, 17825, 76000]))
    time.rule(monkeypatch, "catenary.devices.encoder_board")
    alone = LoopbackNetwork(clock=time)
    monkeypatch.setattr(network, "make_transport", lambda ros, name: Loopback(name, alone))
    yield board
    board.close()


def test_encoders_that_are_not_registered_say_so(encoders: SimulatedEncoders):
    outcome = catenary("encoders", "--port", encoders.link, "--ros", "none", "--duration", "1.3")
    assert outcome.code == 1
    assert "6366 17825 76000 counts" in outcome.out
    assert "not registered: home the robot" in outcome.out


def test_encoders_print_json_lines(encoders: SimulatedEncoders):
    outcome = catenary("encoders", "--port", encoders.link, "--ros", "none", "--duration", "1.3", "--json")
    *each, last = [json.loads(line) for line in outcome.out.splitlines()]
    assert len(each) == 1
    final = last["final"]
    assert final["counts"] == [6366, 17825, 76000]
    assert final["q_encoder"] == [None] * 3
    assert final["line"]["malformed"] == 0
    # every row but one that came after the last look
    assert 0 <= final["line"]["rows"] - final["published"]["/joint_enc"] <= 1
    assert final["published"]["/joint_enc"] == 131  # 1.3 s at 100 Hz, and the first
    assert final["published"]["/ext_jpos"] == 0


def test_gravity_is_published_from_a_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    board = SimulatedBoard(tmp_path / "board", gyroscope=False)
    time = BoardTime(board, lambda: board.line((0.0, 0.0, 9.81 + 0.001 * (board.count % 7))), board.hello)
    time.rule(monkeypatch)
    alone = LoopbackNetwork(clock=time)
    monkeypatch.setattr(network, "make_transport", lambda ros, name: Loopback(name, alone))
    outcome = catenary("gravity-node", "--port", board.link, "--ros", "none", "--duration", "1.5", "--json")
    board.close()
    assert outcome.code == 0
    final = json.loads(outcome.out.splitlines()[-1])["final"]
    assert final["gravity"] == pytest.approx([0.0, 0.0, -9.81], abs=0.05)
    assert final["status"] == "live"
    assert final["published"] == 151  # 1.5 s at 100 Hz, and the first
    assert final["link"]["samples"] == 150


def test_a_topic_on_which_nothing_comes_is_told():
    outcome = catenary("gravity-node", "--imu", "/imu/data_raw", "--ros", "none", "--duration", "0.5")
    assert outcome.code == 1
    assert "nominal" in outcome.out
    assert "nothing_received" in outcome.err
