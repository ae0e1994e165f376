from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import load_cable_arm
from papers.gravity.joint_3 import VARIATIONS, Variation, main, varied_joint_3


def test_only_joint_3_is_varied() -> None:
    nominal = load_cable_arm().cable
    rough = varied_joint_3(Variation("", friction=4.0)).cable
    assert_allclose(rough.link_friction / nominal.link_friction, [1.0, 1.0, 4.0])
    assert_allclose(rough.coupling, nominal.coupling)
    wound = varied_joint_3(Variation("", coupling=0.7)).cable
    # c01 is joint 2's
    assert_allclose(wound.coupling / nominal.coupling, [1.0, 0.7, 0.7])
    assert_allclose(wound.rotor_friction, nominal.rotor_friction)


@pytest.mark.slow
def test_compensation_does_not_make_joint_3_worse_under_more_friction(tmp_path: Path, written) -> None:
    runs = [run for _, run in main(tmp_path, VARIATIONS[1:2], ("z",), ("relative",))]
    error = {run.controller: run.rms_error[2] for run in runs}
    assert max(error["sg"], error["dg"]) < 1.001 * error["pd"]
    results, _ = written(tmp_path, "gravity_joint_3")
    assert {row["variation"] for row in results} == {"friction times 4"}
    assert np.isfinite([row["rms_error"] for row in results]).all()
