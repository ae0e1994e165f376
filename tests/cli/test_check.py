import json
import re
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.files import card_path
from catenary.robots.catalog import robot_names
from command_line import catenary, refusal


def write_text(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", robot_names())
def test_the_catalogue_is_sound(name: str) -> None:
    outcome = catenary("check", name)
    assert outcome.code == 0, outcome
    assert ("nothing wrong found" in outcome.out) == ("remark:" not in outcome.out)


def test_a_faulty_recording_ends_with_1(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz", t=np.arange(400) // 2 / 20.0)
    outcome, plain = catenary("check", path), catenary("check", path, "--json")
    assert outcome.code == plain.code == 1
    for words in ("WRONG:", "200 repeated time stamps in 400 rows", "1 fault(s) found"):
        assert words in outcome.out
    assert plain.json["kind"] == "recording"
    (found,) = (each for each in plain.json["findings"] if each["refuses"])
    assert found["name"] == "stamps"
    assert plain.json["facts"]["rows"] == 200


def test_a_urdf_that_lacks_one_inertia_ends_with_1_and_names_the_link(tmp_path: Path) -> None:
    bare, mass = simulated_arm.URDF_WITHOUT_INERTIA, "<inertial><mass value='1'/>"
    tensor = "<inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial>"
    half = bare.replace('<link name="fore"/>', f'<link name="fore">{mass}{tensor}</link>')
    outcome = catenary("check", write_text(tmp_path / "half.urdf", half))
    assert outcome.code == 1
    assert "no inertia for upper: kinematics work, gravity and torques are refused" in outcome.out
    whole = catenary("check", write_text(tmp_path / "bare.urdf", bare))
    assert whole.code == 0
    assert "has no inertia: kinematics work, gravity and torques are refused" in whole.out


@pytest.mark.parametrize("name", ["model.npz", "model", "model.bin"])
def test_a_model_is_known_by_what_it_holds(model: Path, tmp_path: Path, name: str) -> None:
    outcome = catenary("check", copy(model, tmp_path / name))
    assert "calibration model" in outcome.out
    assert "rows, sha256 " in outcome.out


def test_facts_of_a_model_are_numbers_with_units(model: Path) -> None:
    facts = catenary("check", model, "--json").json["facts"]
    card = json.loads(card_path(model).read_text())
    assert [joint["unit"] for joint in facts["joints"]] == ["rad", "rad", "m"]
    for joint, told in zip(facts["joints"], card["errors"]["cross_validation"]["joints"], strict=True):
        assert joint["error_unit"] == told["unit"]
        assert joint["cross_validation"]["rmse"] == told["rmse_mean"]
    assert [log["sha256"] for log in facts["fitted_to"]] == [log["sha256"] for log in card["data"]]


def test_copy_of_another_models_card_is_told_and_a_lost_one_is_not(model: Path, run: Path, tmp_path: Path) -> None:
    mine = copy(model, tmp_path / "mine.npz")
    assert catenary("check", mine).code == 0
    catenary("fit", run, "--model", "offset", "--out", tmp_path / "other.npz")
    copy(card_path(tmp_path / "other.npz"), card_path(mine))
    outcome = catenary("check", mine)
    assert outcome.code == 1
    assert "mine.card.json: is not the card in mine.npz, which counts" in outcome.out


def keys_of(facts: Any) -> set[str]:
    """The names of facts, but for those of programs and joints."""
    if isinstance(facts, list):
        return set().union(*map(keys_of, facts))
    if not isinstance(facts, dict):
        return set()
    return facts.keys() | set().union(*(keys_of(facts[key]) for key in facts.keys() - {"version", "relative_rms"}))


def test_the_page_of_json_names_every_fact(run: Path, model: Path, motion: Path, tmp_path: Path) -> None:
    identified = tmp_path / "arm.npz"
    catenary("identify", motion, "--robot", "raven2", "--out", identified, "--free", "--friction", "none", "--no-prior")
    facts = [catenary("check", file, "--json").json["facts"] for file in ("raven2", run, model, identified)]
    page = (Path(__file__).parents[2] / "docs" / "json.md").read_text()
    section = page.partition("## Facts of `check --json`")[2].partition("\n#")[0]
    assert set().union(*map(keys_of, facts)) <= set(re.findall("`([a-z0-9_]+)`", section))


NO_TEXT = b'<robot name="\xff\xfe"/>'


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.toml", simulated_arm.DH_TABLE.replace("d_m = 0.1", ""), 'link[1] "slide": d_m: this key is missing'),
        ("a.toml", simulated_arm.DH_TABLE.replace("d_m = 0.1", "d_m = nan"), "d_m"),
        ("a.toml", "name = ", "cannot be read as TOML"),
        ("a.toml", "", "this key is missing"),
        ("a.urdf", "", "cannot be read as XML"),
        ("a.urdf", "<robot name='x'><link name='base'/></robot>", "no moving joint"),
        ("a.xml", "<html/>", "expected <robot> (URDF) or <mujoco> (MJCF)"),
        ("a.npz", "", "cannot be read"),
        ("a.parquet", "", "it is empty"),
        ("a.txt", "hello", "no column of numbers among hello"),
        *((name, NO_TEXT, "cannot be read") for name in ("a.toml", "a.urdf", "a.xml")),
        *((f"a{ending}", None, "is a folder, expected a file") for ending in ("", ".npz", ".toml", ".urdf", ".parquet")),
    ],
)  # fmt: skip
def test_unreadable_ends_with_2(tmp_path: Path, name: str, content: str | bytes | None, words: str) -> None:
    path = tmp_path / name
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    message = refusal("check", path)
    assert words in message
    assert name in message
