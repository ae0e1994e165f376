import json
from pathlib import Path

import numpy as np
import pytest

from colliding_arm import write_arm
from command_line import catenary, refusal


def test_it_designs_poses_and_motions(tmp_path: Path) -> None:
    poses, motion = tmp_path / "poses.npz", tmp_path / "motion.csv"
    content = catenary("excitation", "panda", "--static", 10, "--out", poses, "--json").json
    assert content["rows"] == 10
    assert content["collisions"]["checked"]
    with np.load(poses, allow_pickle=False) as archive:
        assert archive["q"].shape == (10, 7)
    outcome = catenary("excitation", "panda", "--trials", 3, "--period-s", 5, "--out", motion)
    assert "1001 rows, 5 s" in outcome.out
    assert "shapes are assumed, not measured" in outcome.err
    assert "condition: " in outcome.out
    assert len(motion.read_text().splitlines()) == 1002


def test_a_robot_without_limits_takes_them_and_is_told_that_collisions_are_unchecked(tmp_path: Path) -> None:
    bounds = ["--lower=-1,-0.7,0.05,-1,-1,-1,-1", "--upper", "1,0.7,0.2,1,1,1,1"]
    design = ("excitation", "dvrk_psm_motors", "--static", 12, *bounds, "--out", tmp_path / "p.npz")
    outcome = catenary(*design, "--json", "--no-notes")
    assert outcome.json["terms"] == "static"
    assert "COLLISIONS ARE UNCHECKED: dvrk_psm_motors has no shapes" in outcome.err  # --no-notes leaves warnings
    assert (
        "UNCHECKED"
        in catenary("excitation", "panda", "--trials", 2, "--no-collision-check", "--out", tmp_path / "m.npz").out
    )
    assert catenary(*design, "--link-radius-mm", 5, "--json").json["collisions"]["checked"]


def test_it_keeps_clear_of_a_floor_a_box_and_a_mesh(tmp_path: Path) -> None:
    arm = write_arm(tmp_path)
    mesh = tmp_path / "meshes" / "elbow.stl"
    around = ("--floor-m", -0.2, "--box", "1,0,0.5,0.3,0.3,0.3", "--mesh", f"{mesh}@-1,0.5,0", "--margin-mm", 15)
    files = ("--out", tmp_path / "m.npz", "--trajectory", tmp_path / "m.yaml")
    found = catenary("excitation", arm, *around, "--trials", 4, *files, "--ros", 1, "--json").json
    assert found["collisions"]["closest"]["distance_mm"] >= 15.0
    assert not found["collisions"]["assumed"]
    assert json.loads((tmp_path / "m.yaml").read_text())["points"][1]["time_from_start"] == {
        "secs": 0,
        "nsecs": 5000000,
    }


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mesh": "meshes/none.stl"}, "no mesh package://meshes/none.stl"),
        ({"content": b"nothing of the kind"}, "cannot be read as a mesh"),
    ],
)
def test_a_mesh_that_is_missing_or_damaged_is_refused(tmp_path: Path, changes: dict, said: str) -> None:
    arm = write_arm(tmp_path)
    if "mesh" in changes:
        arm.write_text(arm.read_text().replace("meshes/elbow.stl", changes["mesh"]))
    else:
        (tmp_path / "meshes" / "elbow.stl").write_bytes(changes["content"])
    told = refusal("excitation", arm, "--out", tmp_path / "m.npz")
    assert said in told
    assert '"elbow"' in told
