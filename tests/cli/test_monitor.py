import json
from pathlib import Path

import simulated_arm
from command_line import catenary


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
