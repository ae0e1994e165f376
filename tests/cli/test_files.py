import json
import re
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import simulated_arm
from catenary.calibration.fit_options import FitOptions
from catenary.files import card_path
from catenary.recording.logs import read_log
from catenary.robots.catalog import robot_names
from catenary.workflows.project import calibrate
from command_line import catenary, refusal
from lab_bags import two_topics


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
    assert "mine.card.json: differs from the card in mine.npz, which counts" in outcome.out


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


MAP = ("--map", "q_nominal=/raven/joint_cmd.position", "--map", "q_encoder=/optitrack/joints.position")
UNITS = ("--units", "rad,rad,m")


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return two_topics(tmp_path_factory.mktemp("lab") / "lab", "ros1", seconds=12.0)


def test_a_proposal_is_printed_edited_and_imported(bag: Path, tmp_path: Path) -> None:
    proposed = catenary("import", bag)
    assert proposed.code == 0
    assert "--mapping FILE.toml --out LOG.parquet" in " ".join(proposed.err.split())
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(proposed.out)
    log = tmp_path / "lab.parquet"
    done = catenary("import", bag, "--mapping", mapping, "--out", log)
    assert done.code == 0
    assert "outer_insertion [m]" in done.out
    accepted = tmp_path / "accepted.parquet"
    assert catenary("import", bag, "--yes", "--out", accepted).code == 0
    assert_allclose(read_log(log).q_nominal, read_log(accepted).q_nominal)
    assert catenary("check", log).code == 0


def test_without_a_mapping_nothing_is_written(bag: Path, tmp_path: Path) -> None:
    done = catenary("import", bag, "--out", tmp_path / "lab.parquet")
    assert done.code != 0
    assert "[q_nominal]" in done.out
    assert "nothing was written" in done.err
    assert not (tmp_path / "lab.parquet").exists()


def test_commands_take_the_source_with_its_mapping_as_they_take_the_log(bag: Path, tmp_path: Path) -> None:
    log = tmp_path / "lab.parquet"
    assert catenary("import", bag, *MAP, *UNITS, "--out", log).code == 0
    models = [tmp_path / "of_log.npz", tmp_path / "of_bag.npz"]
    fitted = [
        catenary("fit", log, "--model", "offset", "--out", models[0], "--json"),
        catenary("fit", bag, *MAP, *UNITS, "--model", "offset", "--out", models[1], "--json"),
    ]
    assert [one.code for one in fitted] == [0, 0]
    first, second = (json.loads(one.out) for one in fitted)
    assert first["cross_validation"] == second["cross_validation"]
    judged = catenary("evaluate", models[0], bag, "--map", f"{MAP[1]}@rad,rad,m", "--map", MAP[3], "--json")
    assert judged.code == 0
    checked = catenary("check", bag, *MAP, *UNITS, "--json")
    assert json.loads(checked.out)["kind"] == "recording"


def day_in_degrees(path: Path, seed: int, *, turned: bool = False) -> Path:
    """A lab's CSV in degrees and millimetres, semicolons and decimal commas: reported and measured joints at 17 Hz."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 24.0, 0.06)
    phase = rng.uniform(0.0, 6.0, (3, 2))
    q = np.column_stack([np.sin(0.7 * t + a) + 0.5 * np.sin(1.7 * t + b) for a, b in phase]) * [30.0, 20.0, 25.0]
    q += [10.0, 60.0, 150.0]
    seen = 1.02 * q + [0.5, -0.4, 1.0] + 0.01 * rng.standard_normal(q.shape)
    rows = np.column_stack([1000.0 * t, q, -seen if turned else seen])
    lines = [";".join(f"{value:.5f}".replace(".", ",") for value in row) for row in rows]
    path.write_text("Zeit_ms;yaw;pitch;ins;cam_yaw;cam_pitch;cam_ins\n" + "\n".join(lines) + "\n")
    return path


LAB = (
    "--map", "q_nominal=yaw,pitch,ins@deg,deg,mm", "--map", "q_encoder=cam_yaw,cam_pitch,cam_ins@deg,deg,mm",
    "--map", "time=Zeit_ms@ms",
)  # fmt: skip


def test_a_project_is_calibrated_from_foreign_csvs_and_leaves_no_folder_where_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    linear = FitOptions(kind="linear")
    monkeypatch.setattr(calibrate, "models_for", lambda *_: dict.fromkeys(("linear", "recommended"), linear))
    monkeypatch.setattr(calibrate, "write_project_report", lambda page, *_, **__: page.write_text("a page"))
    train, test = (day_in_degrees(tmp_path / f"{name}.csv", k) for k, name in enumerate(("monday", "tuesday")))
    bad, project = day_in_degrees(tmp_path / "bad.csv", 1, turned=True), tmp_path / "project"
    for pair in ((train, bad), (bad, test)):
        refused = catenary("calibrate", project, pair[0], "--test", pair[1], *LAB)
        assert refused.code != 0
        assert "--sign J1" in refused.err
        assert not project.exists()
    line = ("calibrate", project, train, "--test", test, *LAB, "--json")
    found = catenary(*line).json
    assert {path.name.rpartition("-")[0] for path in (project / "imported").iterdir()} == {"monday", "tuesday"}
    for joint in found["models"]["recommended"]:  # deg and mm; what is left is the camera's noise
        assert joint["raw_rmse"] > 0.3
        assert joint["rmse"] < 0.05
    assert catenary("evaluate", project / "models" / "recommended.npz", test, *LAB, "--json").code == 0
    assert catenary(*line).json["steps_run"] == []


def test_an_import_says_at_once_what_a_fit_would_refuse(tmp_path: Path) -> None:
    bad = day_in_degrees(tmp_path / "bad.csv", 1, turned=True)
    done = catenary("import", bad, *LAB, "--out", tmp_path / "bad.parquet")
    assert done.code == 0
    assert "sign: J1: the measurement falls when the command of J1 rises" in " ".join(done.err.split())


def test_a_question_is_answered_on_the_command_line_and_what_was_not_used_is_listed(tmp_path: Path) -> None:
    t = np.arange(0.0, 12.0, 0.02)
    q = np.column_stack([np.sin(t), np.cos(1.3 * t)])
    rows = np.column_stack([t, q, q + 0.02, q + 0.5, q])
    head = "t,cmd_a,cmd_b,vicon_a,vicon_b,camera_a,camera_b,aux1,aux2"
    table, log = tmp_path / "lab.csv", tmp_path / "lab.parquet"
    np.savetxt(table, rows, delimiter=",", header=head, comments="", fmt="%.9f")
    units = ("--units", "rad")
    proposed = catenary("import", table, *units)
    assert "#   --answer q_encoder=camera_a   camera_a ... camera_b" in proposed.out
    asked = catenary("import", table, *units, "--json").json
    assert asked["not_used"] == ["camera_a", "camera_b", "aux1 ... aux2"]
    assert "--answer q_encoder=vicon_a or --answer q_encoder=camera_a" in asked["questions"][0]
    done = catenary("import", table, *units, "--answer", "q_encoder=cam", "--out", log)
    assert done.code == 0, done.err
    assert "not used: vicon_a, vicon_b, aux1 ... aux2" in " ".join(done.err.split())
    assert_allclose(read_log(log).q_encoder, q + 0.5, atol=1e-9)
    for answer, complaint in (
        ("q_encoder=laser", "expected one of vicon_a, camera_a"),
        ("q_encoder=a", "expected one of vicon_a, camera_a"),
        ("time=t", "the proposal does not ask this: which is q_encoder"),
        ("cam", "expected QUESTION=ANSWER"),
    ):
        refused = catenary("import", table, *units, "--answer", answer, "--out", log)
        assert refused.code != 0
        assert complaint in " ".join(refused.err.split())
    (toml := tmp_path / "lab.toml").write_text(proposed.out)
    assert "still OPEN: which is q_encoder" in catenary("import", table, "--mapping", toml, "--out", log).err
    toml.write_text(proposed.out.replace("OPEN", "answered"))
    assert catenary("import", table, "--mapping", toml, "--out", log).code == 0
    mapped = catenary("import", table, "--map", "q_nominal=cmd_*", *units, "--answer", "q_encoder=cam", "--out", log)
    assert "leaves nothing open" in mapped.err
