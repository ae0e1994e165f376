from pathlib import Path

import numpy as np
import pytest

import simulated_arm
from catenary.robots.catalog import robot_names
from command_line import catenary, refusal


def write_text(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", robot_names())
def test_the_catalogue_is_sound(name: str) -> None:
    outcome = catenary("check", name)
    assert outcome.code == 0, outcome
    assert "nothing wrong found" in outcome.out


def test_a_sound_recording_ends_with_0(tmp_path: Path) -> None:
    outcome = catenary("check", simulated_arm.write(tmp_path / "run.npz"))
    assert (outcome.code, outcome.err) == (0, "")
    assert "recording" in outcome.out
    assert "13.3 s" in outcome.out


def test_a_faulty_recording_ends_with_1(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz", t=np.zeros(400))
    outcome = catenary("check", path)
    assert outcome.code == 1
    assert "WRONG:" in outcome.out
    assert "399 repeated time stamps" in outcome.out
    assert "1 fault(s) found" in outcome.out


def test_json_holds_kind_facts_faults_and_remarks(tmp_path: Path) -> None:
    outcome = catenary("check", simulated_arm.write(tmp_path / "run.npz", t=np.zeros(400)), "--json")
    assert outcome.code == 1
    assert outcome.json["kind"] == "recording"
    assert outcome.json["faults"] == ["399 repeated time stamps"]
    assert outcome.json["facts"]["rows"].startswith("400")


def test_units_can_be_given_for_a_recording_without(tmp_path: Path) -> None:
    four = np.zeros((50, 4))
    path = simulated_arm.write(tmp_path / "four.npz", rows=50, q_des=four, q_act=four, units=None)
    assert "--units" in refusal("check", path)
    assert "J4 [m]" in catenary("check", path, "--units", "rad,rad,rad,m").out


def test_a_urdf_without_inertia_ends_with_1_and_names_the_links(tmp_path: Path) -> None:
    path = write_text(tmp_path / "bare.urdf", simulated_arm.URDF_WITHOUT_INERTIA)
    outcome = catenary("check", path)
    assert outcome.code == 1
    assert "no inertia for upper, fore: kinematics work, torques and masses are refused" in outcome.out


def test_a_table_is_a_robot(tmp_path: Path) -> None:
    outcome = catenary("check", write_text(tmp_path / "arm.toml", simulated_arm.DH_TABLE), "--json")
    assert outcome.code == 0
    assert outcome.json["facts"]["massless links"] == "slide"


@pytest.mark.parametrize("name", ["model.npz", "model", "model.bin"])
def test_a_model_is_known_by_what_it_holds(tmp_path: Path, name: str) -> None:
    run = simulated_arm.write(tmp_path / "run.npz")
    catenary("fit", run, "--model", "linear", "--out", tmp_path / name)
    outcome = catenary("check", tmp_path / name)
    assert "calibration model" in outcome.out
    assert "run (sha256 " in outcome.out


def test_an_offset_is_not_worse_than_itself(tmp_path: Path) -> None:
    run = simulated_arm.write(tmp_path / "run.npz")
    catenary("fit", run, "--model", "offset", "--out", tmp_path / "model.npz")
    assert catenary("check", tmp_path / "model.npz").code == 0


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        (
            "a.toml",
            simulated_arm.DH_TABLE.replace("d_m = 0.1", ""),
            'link[1] "slide": d_m: this key is missing',
        ),
        ("a.toml", simulated_arm.DH_TABLE.replace("d_m = 0.1", "d_m = nan"), "d_m"),
        ("a.toml", "name = ", "cannot be read as TOML"),
        ("a.toml", "", "this key is missing"),
        ("a.urdf", "", "cannot be read as XML"),
        ("a.urdf", "<robot name='x'><link name='base'/></robot>", "no moving joint"),
        ("a.xml", "<html/>", "expected <robot> (URDF) or <mujoco> (MJCF)"),
        ("a.npz", "", "cannot be read"),
        ("a.parquet", "", "cannot be read"),
        ("a.txt", "hello", 'ending ".txt"'),
    ],
)
def test_what_cannot_be_read_ends_with_2(tmp_path: Path, name: str, content: str, words: str) -> None:
    message = refusal("check", write_text(tmp_path / name, content))
    assert words in message
    assert name in message


@pytest.mark.parametrize("name", ["a.toml", "a.urdf", "a.xml"])
def test_what_is_no_text_ends_with_2(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b'<robot name="\xff\xfe"/>')
    assert "cannot be read" in refusal("check", tmp_path / name)


@pytest.mark.parametrize("name", ["folder", "folder.npz", "folder.toml", "folder.urdf", "folder.parquet"])
def test_a_folder_is_no_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    assert "is a folder, expected a file" in refusal("check", tmp_path / name)


def test_a_name_that_is_nothing_is_refused_with_the_catalogue() -> None:
    assert "no such file, and no robot of that name; robots: dual_arm_19, dvrk_mtm" in refusal(
        "check", "raven"
    )
