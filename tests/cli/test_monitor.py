import json
from pathlib import Path

import pytest

import simulated_arm
from command_line import catenary, refusal


def test_a_recording_is_played_as_lines_of_json(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz")
    outcome = catenary("monitor", "--log", path, "--json", "--speed", "1000", "--rate", "200")
    assert outcome.code == 0, outcome
    lines = [json.loads(line) for line in outcome.out.splitlines()]
    assert lines[-1]["time"] > 13.0  # the recording is 13.3 s long
    assert lines[-1]["gravity"] is None  # nobody tells


def test_a_simulated_robot_is_watched_in_plain_lines() -> None:
    outcome = catenary("monitor", "--seconds", "0.5", "--rate", "10")
    assert outcome.code == 0, outcome
    assert "ENABLED, homed" in outcome.out
    assert "shoulder=30" in outcome.out or "shoulder=29" in outcome.out


def test_a_robot_on_ros_is_never_moved() -> None:
    assert "only read" in refusal("monitor", "--ros", "1", "--moving")


def test_a_rate_that_is_none_is_refused() -> None:
    assert "--rate" in refusal("monitor", "--rate", "0")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--gravity", "/gravity"), "go with --ros"),
        (("--ros", "1", "--gravity", "/gravity", "--imu", "/imu"), "one of --gravity and --imu"),
        (("--ros", "1", "--gravity", "/gravity", "--mounting", "m.toml"), "goes with --imu"),
        (("--ros", "1", "--imu", "/imu", "--mounting", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_sources_of_gravity_that_do_not_go_together_are_refused(
    options: tuple[str, ...], message: str
) -> None:
    assert message in refusal("monitor", *options)
