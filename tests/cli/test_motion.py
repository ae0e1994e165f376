from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from command_line import catenary


def test_goto_arrives_and_says_how_well() -> None:
    outcome = catenary("goto", "--q-deg", "33,88,395", "--fast", "--json")
    assert outcome.code == 0, outcome
    shoulder, elbow, insertion, *_ = outcome.json["joints"]
    # what the robot reports differs from its setpoint by its control error, 0.2 deg and 1 mm at rest
    assert_allclose(np.rad2deg([shoulder["q"], elbow["q"]]), [33.0, 88.0], atol=0.3)
    assert_allclose(insertion["q"], 0.395, atol=1e-3)
    assert outcome.json["state"]["state"] == "PAUSED"
    assert not outcome.json["interrupted"]


def test_any_joint_is_moved_by_its_name() -> None:
    outcome = catenary("goto", "--joints", "elbow", "--q-deg", "85", "--fast")
    assert outcome.code == 0, outcome
    assert "elbow" in outcome.out


def test_a_file_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time [s],shoulder [deg],insertion [mm]\n0,31,400\n1,33,398\n")
    outcome = catenary("follow", path, "--fast", "--json")
    assert outcome.code == 0, outcome
    assert outcome.json["duration_s"] > 1.0
