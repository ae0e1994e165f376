import json
from pathlib import Path

import numpy as np
import pytest

from catenary.reproduce.gravity_static import main, static_poses

FEW = (5.0, 85.0)


@pytest.mark.slow
def test_placed_arm_needs_no_pd_with_sensed_gravity_and_much_with_nominal_one() -> None:
    tilted = static_poses(None, 25.0, "placed", poses_deg=FEW)
    level = static_poses(None, 0.0, "placed", poses_deg=FEW, controllers=("sg", "dg"))
    assert tilted["dg"].share[0] < 0.15
    assert tilted["sg"].share[0] > 0.40
    assert tilted["pd"].share[0] == pytest.approx(1.0)
    assert level["sg"].share[0] < 0.15
    np.testing.assert_allclose(
        level["sg"].torque, level["dg"].torque, atol=1e-12
    )  # on a level base they are one


@pytest.mark.slow
def test_driven_arm_leaves_the_friction_to_the_pd() -> None:
    tilted = static_poses(None, 25.0, "driven", poses_deg=FEW, controllers=("sg", "dg"))
    # the friction of joint 1: 0.15 + 0.16 Nm and a tenth of the load, of 2 to 3 Nm
    assert tilted["dg"].share[0] < 0.25
    assert tilted["sg"].share[0] > 0.40


@pytest.mark.slow
def test_page_and_data_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(tmp_path, (None,), (0, 25), FEW)
    content = json.loads((tmp_path / "gravity_static.json").read_text())
    assert {(row["approach"], row["base_deg"], row["controller"]) for row in content["results"]} == {
        (a, b, c) for a in ("placed", "driven") for b in (0, 25) for c in ("pd", "sg", "dg")
    }
    assert "PD share of joint 1, placed" in capsys.readouterr().out
    assert "figure 8" in (tmp_path / "gravity_static.html").read_text()
