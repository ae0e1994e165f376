"""The on-line estimators on a recording of a real arm, beside a batch identification of the same rows."""

from pathlib import Path

import pytest

from papers.regressor.recorded_arms import replay


@pytest.mark.slow
def test_poses_of_a_real_arm_are_replayed(recordings: Path) -> None:
    name = "dvrk_mtm_static_gravity/grid4_pos.npz"
    if not (recordings / name).is_file():
        pytest.skip(f"no recording {recordings / name}")
    rms = replay(name, 200, recordings)["rms_Nm_or_N"]
    assert rms["batch, gravity"][1] < rms["least squares"][1] < 0.5 * rms["none"][1]
