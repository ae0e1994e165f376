"""A tool is weighed by poses of an arm whose sensor's readings Pinocchio makes."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.robots.catalog import load_robot
from command_line import catenary, refusal

MASS, CENTER, BIASES = 0.82, np.array([0.01, -0.02, 0.09]), np.array([3.0, -5.0, 12.0, 0.2, 0.05, -0.3])


def poses_of_ur10e(path: Path, rng: np.random.Generator, columns: int | None = None) -> Path:
    pin = pytest.importorskip("pinocchio")
    from catenary.robots.urdf_export import urdf_text

    arm = load_robot("ur10e")
    model = pin.buildModelFromXML(urdf_text(arm))
    data, frame, rows = model.createData(), model.getFrameId(arm.tip), []
    for q in rng.uniform(-2.0, 2.0, (12, 6)):
        pin.framesForwardKinematics(model, data, pin.neutral(model) + q)
        weight = data.oMf[frame].rotation.T @ [0.0, 0.0, -9.81 * MASS]
        rows.append([*q, *(np.r_[weight, np.cross(CENTER, weight)] + BIASES + 0.01 * rng.normal(size=6))])
    header = ",".join((*arm.joint_names, "fx", "fy", "fz", "tx", "ty", "tz")[:columns])
    np.savetxt(path, np.array(rows)[:, :columns], delimiter=",", header=header, comments="")
    return path


def test_mass_centre_and_biases_come_out_of_a_table_of_poses(tmp_path: Path, rng: np.random.Generator) -> None:
    table = poses_of_ur10e(tmp_path / "poses.csv", rng)
    found = catenary("payload", table, "--wrist-sensor", "ur10e", "--json").json
    assert found["mass"] == pytest.approx(MASS, abs=4.0 * found["mass_deviation"])
    assert found["mass_deviation"] < 0.002
    assert_allclose(found["center"], CENTER, atol=2e-3)
    assert_allclose([*found["force_bias"], *found["torque_bias"]], BIASES, atol=0.02)
    assert re.search(r"mass +0\.8", catenary("payload", table, "--wrist-sensor", "ur10e").out)


def test_what_is_missing_is_named(tmp_path: Path, rng: np.random.Generator) -> None:
    table = poses_of_ur10e(tmp_path / "poses.csv", rng, columns=-1)
    assert "no column tz" in refusal("payload", table, "--wrist-sensor", "ur10e")
    assert "one of --model and --wrist-sensor" in refusal("payload", table)
