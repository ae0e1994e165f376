from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from command_line import catenary, refusal


def test_goto_arrives_and_says_how_well() -> None:
    outcome = catenary("goto", "--q-deg", "33,88,395", "--fast", "--json")
    assert outcome.code == 0, outcome
    shoulder, elbow, insertion, *_ = outcome.json["joints"]
    # what the robot reports differs from its setpoint by its control error, 0.2 deg and 1 mm at rest
    assert_allclose(np.rad2deg([shoulder["q"], elbow["q"]]), [33.0, 88.0], atol=0.3)
    assert_allclose(insertion["q"], 0.395, atol=1e-3)
    assert outcome.json["state"]["state"] == "ENABLED"
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


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["goto", "--fast"], "give one of"),
        (["goto", "--q-deg", "1,2", "--position-mm", "1,2,3", "--fast"], "give one of"),
        (["goto", "--q-deg", "900,90,400", "--fast"], "shoulder"),
        (["goto", "--q-deg", "1", "--joints", "nose", "--fast"], "nose"),
        (["goto", "--position-mm", "0,0,9000", "--fast"], "joint limits refuse"),
        (["goto", "--q-deg", "30", "--yes"], "go with --ros"),
        (["goto", "--q-deg", "30", "--ros", "3"], "expected 1 or 2"),
        (["goto", "--q-deg", "30", "--ros", "1", "--fast"], "not with --ros"),
        (["random", "--seconds", "0.1", "--fast"], "duration"),
    ],
)
def test_what_cannot_be_done_is_refused(arguments: list[str], complaint: str) -> None:
    assert complaint in refusal(*arguments)
