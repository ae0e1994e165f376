"""Servers that stand still while an arm moves: a case of the campaign over each network."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaign.part import found_parts

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("part", ["stalls.ros1", "stalls.ros2"])
def test_an_arm_whose_program_is_killed_while_its_server_stands_still_is_paused(part: str, tmp_path: Path) -> None:
    if part not in found_parts():
        pytest.skip(f"{part}: its network is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaign", part, "--seed", "3", "--count", "1", "--out", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 tried     0 failed" in done.stdout, done.stdout + done.stderr
