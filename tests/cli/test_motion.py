import re
import signal
import termios
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.open_robot import Simulated
from catenary.robots.catalog import load_robot
from catenary.workflows.robot.operated_robot import OperatedRobot, operated_robot
from catenary.workflows.robot.operator_motion import go_to_joints
from command_line import catenary
from typist import Typist


@pytest.fixture(scope="module")
def went() -> Any:
    """What a simulated robot tells of a way to 33 deg, 88 deg, 395 mm."""
    outcome = catenary("goto", "--q-deg", "33,88,395", "--fast", "--json")
    assert outcome.code == 0, outcome
    return outcome.json


def test_goto_arrives_and_says_how_well(went: Any) -> None:
    shoulder, elbow, insertion, *_ = went["joints"]
    # what the robot reports differs from its setpoint by its control error, friction over stiffness: 0.4 deg and 1 mm
    assert_allclose(np.rad2deg([shoulder["q"], elbow["q"]]), [33.0, 88.0], atol=0.5)
    assert_allclose(insertion["q"], 0.395, atol=1e-3)
    assert went["state"]["state"] == "PAUSED"
    assert not went["interrupted"]


def test_a_file_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time [s],shoulder [deg],insertion [mm]\n0,31,400\n1,33,398\n")
    outcome = catenary("follow", path, "--fast", "--json")
    assert outcome.code == 0, outcome
    assert outcome.json["duration_s"] > 1.0


def test_goto_tells_joints_in_the_units_they_were_asked_in_and_the_tip() -> None:
    in_si = catenary("goto", "--robot", "two_link", "--q", "0.3,0.4", "--fast").out
    assert "0.3000 rad" in in_si
    assert "deg" not in in_si
    in_deg = catenary("goto", "--robot", "two_link", "--q-deg", "30,40", "--fast").out
    assert "30.000 deg" in in_deg
    assert " rad" not in in_deg
    assert "tip (hand): " in in_deg
    x, y, z = forward_kinematics(load_robot("two_link"), np.deg2rad([30.0, 40.0])).position
    assert f"{1000 * x:.1f}, {1000 * y:.1f}, {1000 * z:.1f} mm in the base frame" in in_deg


def test_goto_a_place_says_how_far_from_it_the_tool_ended() -> None:
    out = catenary("goto", "--position-mm", "19,-7.4,-67", "--fast").out
    left = float(re.search(r"distance from the goal: ([0-9.]+) mm", out).group(1))
    assert 0.0 < left < 2.0  # the control error of a robot at rest, at its tool


def test_a_simulation_tells_the_true_error_of_joints_and_wrist(went: Any) -> None:
    plant = operated_robot("raven2", Simulated(), real_time=False).plant
    go_to_joints(OperatedRobot("raven2", plant, load_robot("raven2"), lambda: 0), np.array([0.57596, 1.53589, 0.395]))
    true = plant.telemetry()["q_true"]
    error = [joint["true_error"] for joint in went["joints"]]
    assert_allclose(
        error[:3], plant.measured_js().q[:3] - true, atol=1e-4
    )  # another arrival, to a hundredth of a degree
    assert error[3:] == [None] * 4
    model = load_robot("raven2")
    apart = [forward_kinematics(model, q).position for q in (plant.measured_js().q[:3], true)]
    assert went["true_error"]["frame"] == "wrist"
    assert_allclose(went["true_error"]["distance"], np.linalg.norm(apart[0] - apart[1]), atol=1e-4)


@pytest.mark.slow
def test_a_signal_pauses_the_robot_and_restores_the_terminal() -> None:
    with Typist() as typist:
        typist.wait_for(b"catenary teleop")
        typist.process.send_signal(signal.SIGTERM)
        end = typist.end()
        assert end["ended_by"] == "SIGTERM"
        assert end["state"]["state"] == "PAUSED"
        assert termios.tcgetattr(typist.slave) == typist.before
