import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary.identification.identification_file import load_identification
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from colliding_arm import write_arm
from command_line import catenary, refusal
from moving_arm import PLACE, recorded, write_npz

pytestmark = pytest.mark.usefixtures("undrawn")
ARM = load_robot("raven2")
QUICK = ("--no-prior", "--friction", "none")  # in a third of the time


@pytest.fixture(scope="module")
def identified(moving_arm_logs: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """An arm's parameters, and what the command said of them."""
    out, log, test = (tmp_path_factory.mktemp("out") / "arm.npz", *(moving_arm_logs / f"run{k}.npz" for k in (0, 1)))
    outcome = catenary("identify", log, "--robot", "raven2", "--out", out, "--test", test, "--json", *QUICK)
    assert outcome.code == 0, outcome
    return out, outcome.json


@pytest.fixture
def parameters(identified: tuple[Path, Any]) -> Path:
    return identified[0]


def test_identify_prints_counts_condition_and_residuals(identified: tuple[Path, Any]) -> None:
    content = identified[1]
    assert {"n_base", "condition", "rank", "training", "tests"} <= set(content)
    assert content["n_base"] == content["rank"]
    (test,) = content["tests"]
    assert (test["log"], test["verdict"]) == ("run1", "holds")
    assert [len(test[key]) for key in ("relative_rms", "rms")] == [3, 3]
    assert content["training"][0]["verdict"] is None


def test_identify_writes_parameters_card_page_and_urdf(moving_arm_logs: Path, tmp_path: Path) -> None:
    out, page, urdf = (tmp_path / f"arm.{ending}" for ending in ("npz", "html", "urdf"))
    log = moving_arm_logs / "run0.npz"
    written = ("--out", out, "--report", page, "--urdf", urdf, *QUICK)
    outcome = catenary("identify", log, "--robot", "raven2", "--test", log, *written)
    assert outcome.code == 0
    assert "Residual over torque" in outcome.out
    assert "is one of the recordings that were fitted: no test" in outcome.err
    assert load_identification(out)[0].model.name == "raven2"
    assert json.loads((tmp_path / "arm.card.json").read_text())["data"][0]["use"] == "fitted"
    html = page.read_text()
    sections = (
        "Excitation",
        "Base parameters",
        "Torques of run0",
        "The robot in 9 poses of run0",
        "data:image/png;base64",
        "assumed friction",
    )
    assert all(words in html for words in sections)
    assert load_urdf(urdf).tree.mass.min() > 0.0


def test_check_says_what_a_parameter_file_is(parameters: Path) -> None:
    content = catenary("check", parameters, "--json").json
    assert content["kind"] == "identified dynamics"
    assert content["facts"]["robot"] == "raven2"
    training, test = content["facts"]["recordings"]
    assert (training["part"], test["part"]) == ("training", "test")
    assert list(training["relative_rms"]) == ["shoulder", "elbow", "insertion"]


def test_payload_weighs_a_mass_at_its_place(moving_arm_logs: Path, parameters: Path) -> None:
    line = ("payload", moving_arm_logs / "loaded.npz", "--model", parameters, "--at", "wrist")
    content = catenary(*line, *PLACE, "--json").json
    assert content["mass"] == pytest.approx(0.2, abs=0.01)
    assert (content["detected"], content["link"], content["candidates"]) == (True, "insertion", [])
    assert content["confidence"] > 0.99
    assert len(content["moment"]) == 3
    assert "mass:" in catenary(*line, "-0.1", "-0.1", "0").out


def test_payload_anywhere_names_the_link_and_the_others(moving_arm_logs: Path, parameters: Path) -> None:
    outcome = catenary("payload", moving_arm_logs / "loaded.npz", "--model", parameters)
    assert "payload on insertion" in outcome.out
    assert "Links that could carry it" in outcome.out
    assert "carries a body" not in outcome.out + outcome.err  # the estimate tells of it


def test_no_payload_is_said(moving_arm_logs: Path, parameters: Path) -> None:
    unloaded = moving_arm_logs / "run1.npz"
    line = ("payload", unloaded, "--model", parameters)
    assert catenary(*line, "--at", "wrist", *PLACE).out.startswith("no payload")
    assert not catenary(*line, "--unloaded", unloaded, "--cutoff-hz", 5, "--json").json["detected"]


def test_a_payload_is_not_weighed_by_torques_of_another_sign_or_unit(
    moving_arm_logs: Path, parameters: Path, tmp_path: Path
) -> None:
    with np.load(moving_arm_logs / "loaded.npz", allow_pickle=False) as archive:
        content = dict(archive)
    joint = load_robot("raven2").joint_names[1]
    for factor, name, mend in (
        (-1.0, "sign", ("--sign", f"tau:{joint}")),
        (0.02, "torques", ("--scale", f"tau:{joint}=50")),
    ):
        tau = content["tau"].copy()
        tau[:, 1] *= factor
        np.savez(tmp_path / "spoilt.npz", **{**content, "tau": tau})
        line = ("payload", tmp_path / "spoilt.npz", "--model", parameters, "--at", "wrist", *PLACE)
        assert f"nothing was weighed; to continue anyway: --accept {name}" in refusal(*line)
        assert catenary(*line, *mend, "--json").json["mass"] == pytest.approx(0.2, abs=0.01)


RUN = recorded(ARM, 0, seconds=4.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tau": np.full((800, 3), np.inf)}, "800 of 800 rows without tau"),
        ({"q": np.repeat(RUN.q_nominal[:1], 800, axis=0), "dq": np.zeros((800, 3))}, "base parameters (condition"),
        ({"q": RUN.q_nominal[:, :2], "dq": RUN.qd[:, :2], "tau": RUN.tau[:, :2]}, 'has joints J1 [rad], J2 [rad]; robot "raven2" has'),
    ],
)  # fmt: skip
def test_a_recording_that_cannot_be_used_is_refused(tmp_path: Path, changes: dict, words: str) -> None:
    write_npz(RUN, tmp_path / "log.npz", **changes)
    out = tmp_path / "o.npz"
    assert words in refusal("identify", tmp_path / "log.npz", "--robot", "raven2", "--out", out)
    assert not out.exists()


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
