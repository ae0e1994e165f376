from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from catenary.cli import beside_robot
from command_line import catenary, refusal
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import EncodedPlant


@pytest.fixture
def on_ros(monkeypatch: pytest.MonkeyPatch) -> RobotOnLoopback:
    """A robot, not homed, where the command looks for one on ROS."""
    robot = RobotOnLoopback(EncodedPlant(ready=False), every=5)

    @contextmanager
    def transport(_: int, __: str = "") -> Iterator[Any]:
        yield robot.transport

    monkeypatch.setattr(beside_robot, "ros_transport", transport)
    return robot


def test_a_simulated_robot_is_homed_without_a_project() -> None:
    found = catenary("home", "--json").json
    assert found["run"]
    assert found["state"] == {"state": "ENABLED", "is_homed": True, "is_busy": False}
    assert found["seconds"] > 5.0
    # the rig and the robot register the same stops 7.5 deg apart at the elbow, and the cables stretch
    assert abs(found["external_encoders"][1] - found["believed"][1] + 0.1309) < 0.05


def test_a_robot_on_ros_is_homed_without_a_project(on_ros: RobotOnLoopback) -> None:
    outcome = catenary("home", "--ros", "1", "--yes")
    assert outcome.code == 0, outcome
    assert "raven2: homed in" in outcome.out
    assert on_ros.robot.plant.operating_state().is_homed


def test_a_robot_on_ros_that_is_homed_is_left_alone(on_ros: RobotOnLoopback) -> None:
    catenary("home", "--ros", "1", "--simulated")
    assert "homed before; nothing has moved" in catenary("home", "--ros", "1").out


def test_nobody_at_the_terminal_moves_no_robot(on_ros: RobotOnLoopback) -> None:
    assert "nothing has moved" in refusal("home", "--ros", "1")
    assert not on_ros.robot.plant.operating_state().is_homed
