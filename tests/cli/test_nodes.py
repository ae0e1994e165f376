import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from catenary.cli.exit_codes import EndedBySignal
from catenary.cli.terminal import if_read
from catenary.crtk import network
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.nodes import serve
from catenary.nodes.tool_node import WRENCH
from catenary.robots.catalog import load_robot
from catenary.sensing.wrist_tool import WristTool, save_tool
from command_line import catenary
from oracles.manual_time import BoardTime, ManualTime
from oracles.simulated_board import SimulatedBoard
from oracles.simulated_encoders import SimulatedEncoders
from oracles.ticking_clock import TickingClock


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


def test_a_loop_waits_for_nobody_who_reads_its_lines(monkeypatch: pytest.MonkeyPatch):
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    printed: list[str] = []
    with os.fdopen(reader, "rb", 0) as lines, os.fdopen(writer, "wb", 0) as pipe, monkeypatch.context() as patch:
        while pipe.write(bytes(2**16)):
            pass
        patch.setattr(sys, "stdout", pipe)
        show = if_read(printed.append)
        show("while the pipe is full")
        lines.read(2**20)
        show("when it was read")
    assert printed == ["when it was read"]


def test_a_topic_on_which_nothing_comes_is_told():
    outcome = catenary("gravity-node", "--imu", "/imu/data_raw", "--ros", "none", "--duration", "0.5")
    assert outcome.code == 1
    assert "nominal" in outcome.out
    assert "nothing_received" in outcome.err


@pytest.fixture
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks take no time, and time passes between them only."""
    monkeypatch.setattr(serve, "time", ManualTime())


@pytest.mark.usefixtures("_no_waiting")
def test_serving_prints_a_line_a_second_and_sums_up():
    result = catenary("serve", "--ros", "none", "--homed", "--duration", "1.5", "--json")
    assert result.code == 0, result.err
    lines = [json.loads(line) for line in result.out.splitlines()]
    assert [line["final"] for line in lines] == [False, True]
    assert lines[-1]["states"] == {"gold": "PAUSED homed", "green": "parked"}
    assert lines[-1]["rate_hz"] == pytest.approx(1000.0, rel=1e-3)
    assert lines[-1]["lost_ticks"] == 0


@pytest.mark.usefixtures("_no_waiting")
def test_a_signal_pauses_the_arms_and_the_last_lines_say_so(monkeypatch):
    heard = []

    def show(status):
        heard.append(status)
        raise EndedBySignal("SIGTERM")

    monkeypatch.setattr("catenary.cli.nodes._show", show)
    result = catenary("serve", "--ros", "none", "--homed", "--start", "--duration", "60")
    assert heard
    assert "ended by SIGTERM: gold PAUSED homed, green parked" in result.err


@pytest.mark.usefixtures("_no_waiting")
def test_a_person_reads_state_and_rate():
    options = ("--dialect", "crtk", "--duration", "1.2", "--rate", "200")
    result = catenary("serve", "--ros", "none", "--homed", *options)
    assert "gold DISABLED homed" in result.out
    assert "without ROS" in result.err


class RestingWrist(TickingClock):
    """While time passes, an arm at rest says where its joints are, and its sensor what 1 kg and 5 N along x ask of it."""

    def __init__(self) -> None:
        super().__init__(0.01)
        self.network = LoopbackNetwork(clock=self)
        self.arm = Loopback("arm", self.network)
        self.sensor = self.arm.publisher("/wrench", WRENCH)
        self.joints = self.arm.publisher("/joint_states", "sensor_msgs/JointState")

    def tick(self) -> None:
        xyz, wrench = message_class("geometry_msgs/Vector3"), message_class("geometry_msgs/Wrench")
        now, names = self.arm.now(), load_robot("two_link").joint_names
        self.joints.publish(joint_state_message(names, now, [0.0, 0.0], [0.0, 0.0]))
        self.sensor.publish(message_class(WRENCH)(header(now, "ft"), wrench(xyz(5.0, 0.0, -9.81), xyz())))


def test_a_wrench_is_published_without_the_tool_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    zeros, world = np.zeros(3), RestingWrist()
    tool = WristTool(1.0, zeros, zeros, zeros, 0.0, zeros, zeros, zeros, 0.0, 0.0, robot="two_link", frame="base")
    save_tool(tmp_path / "tool.toml", tool)
    monkeypatch.setattr(network, "make_transport", lambda ros, name: Loopback(name, world.network))
    line = ("tool-node", "--tool", tmp_path / "tool.toml", "--ros", "none", "--duration", "1.5")
    outcome = catenary(*line, "--json")
    assert outcome.code == 0
    final = json.loads(outcome.out.splitlines()[-1])["final"]
    assert final["status"] == "live"
    assert final["wrench"] == pytest.approx([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
    assert re.search(r"live  force +\+5\.00 ", catenary(*line).out)
    assert catenary(*line, "--joints", "/nothing").code == 1
