from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary.calibration.model_file import save_model
from catenary.control.realtime import Timing
from catenary.errors import TransportError
from catenary.nodes.calibrated_topics import CalibratedTopics
from catenary.plant import MotionLog
from command_line import catenary
from oracles.crtk_robot import RobotOnLoopback
from recordings import fitted


@pytest.fixture
def beside(on_ros: RobotOnLoopback, tmp_path: Path) -> Path:
    """A model for a robot on ROS that is homing."""
    on_ros.robot.plant.state_command("home")
    q = np.random.default_rng(0).uniform(0.3, 0.4, (400, 3))
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    log = MotionLog("run", names, units, q, np.ones(400, dtype=bool), q + 0.01, time=np.arange(400) / 30.0)
    inputs = tuple(f"q:{name}" for name in names)
    path = tmp_path / "arm.npz"
    save_model(fitted(log, kind="linear", inputs=inputs), {}, path)
    return path


def test_a_deployment_reports_whatever_ends_it(
    on_ros: RobotOnLoopback, beside: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def ends(topics: CalibratedTopics, seconds: float) -> Any:
        calls.append(seconds)
        if len(calls) == 3:
            raise TransportError("the ROS node was shut down")
        for _ in range(100):
            on_ros.transport.sleep(0.001)
        topics.step()
        return topics.report()

    monkeypatch.setattr(CalibratedTopics, "run", ends)
    outcome = catenary("deploy", beside, "--ros", 1, "--json")
    assert outcome.code == 2
    assert "the ROS node was shut down" in outcome.err
    assert outcome.json["messages"] > 0


@pytest.mark.parametrize(("median", "code"), [(2e-4, 0), (3.4e-3, 1)])
def test_deploy_beside_a_robot(beside: Path, monkeypatch: pytest.MonkeyPatch, median: float, code: int) -> None:
    report = CalibratedTopics.report

    def timed(topics: CalibratedTopics) -> Any:
        found = vars(report(topics)) | {"rate_hz": 1000.0, "latency": Timing(median, median, median, median)}
        return type(report(topics))(**found)

    def ends(topics: CalibratedTopics, seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(CalibratedTopics, "report", timed)
    monkeypatch.setattr(CalibratedTopics, "run", ends)
    outcome = catenary("deploy", beside, "--ros", 1, "--json")
    assert outcome.code == code
    assert outcome.json["keeps_up"] is (code == 0)
    assert ("3.40 ms in the median" in outcome.err) is (code == 1)
