"""catenary drift and refresh: a model and the days after its own."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.model_file import load_model
from catenary.files import card_path, sha256_of
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from command_line import catenary, refusal
from moving_arm import recorded, write_npz
from tests.verdict.test_delay import cable_arm

pytestmark = pytest.mark.usefixtures("undrawn")
MAY_14, DAY = 1778716800.0, 86400.0  # [s since 1970] midnight of 14 May 2026, UTC


def a_day(number: int, zero: float) -> MotionLog:
    rng = np.random.default_rng(number)
    t = np.arange(1800) / 30.0
    q = np.column_stack([np.sin(0.7 * t), 0.1 * np.cos(1.3 * t)])
    error = np.column_stack([0.03 * q[:, 0], zero + 0.02 * q[:, 1]]) + 1e-4 * rng.standard_normal(q.shape)
    time = MAY_14 + DAY * number + t
    return MotionLog(f"day {number}", ("J1", "J2"), ("rad", "m"), q, np.ones(len(q), bool), q + error, time)


def written(log: MotionLog, path: Path) -> str:
    write_parquet(log, path)
    return str(path)


@pytest.mark.parametrize("folds", ["5", "0"])
def test_the_date_since_when_a_joint_drifts_is_told(tmp_path: Path, folds: str) -> None:
    days = [written(a_day(k, 1e-3 * (k >= 2)), tmp_path / f"{k}.parquet") for k in range(4)]
    model = str(tmp_path / "arm.npz")
    fitted = ("fit", days[0], "--model", "linear", "--folds", folds, "--held-out", "0.2", "--out", model)
    assert catenary(*fitted).code == 0
    page = tmp_path / "drift.html"
    result = catenary("drift", model, *days[1:], "--json", "--report", str(page))
    assert "J2: beyond since 2026-05-16" in page.read_text()
    assert "data:image/png" in page.read_text()
    assert result.code == 1
    found = json.loads(result.out)
    assert found["beyond_since"] == {"J1": None, "J2": 1}
    assert found["in_words"] == ["J2: beyond since 2026-05-16"]
    assert catenary("drift", model, days[1]).code == 0


@pytest.fixture(scope="module")
def of_day_0(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, and beside it the recording that it is of, monday.parquet."""
    folder = tmp_path_factory.mktemp("model")
    line = ("fit", written(a_day(0, 0.0), folder / "monday.parquet"), "--model", "linear", "--out", folder / "arm.npz")
    assert catenary(*line).code == 0
    return folder / "arm.npz"


def test_a_homing_cuts_a_recording(of_day_0: Path, tmp_path: Path) -> None:
    log = a_day(1, 0.0)
    homed = np.arange(len(log)) >= 900
    assert log.q_encoder is not None
    shifted = log.q_encoder + np.column_stack([np.zeros(len(log)), 1e-3 * homed])
    log = replace(log, q_encoder=shifted, signals={"encoffsets:elbow": 7.0 * homed})
    found = catenary("drift", of_day_0, written(log, tmp_path / "1.parquet"), "--json").json
    assert [(s["homing"], s["rows"], s["beyond"]) for s in found["stretches"]] == [
        (0, 900, [False, False]),
        (1, 900, [False, True]),
    ]


def in_deg_and_mm(log: MotionLog) -> MotionLog:
    """The log in deg and mm, though it says rad and m."""
    factor = np.array([np.rad2deg(1.0), 1e3])
    assert log.q_encoder is not None
    return replace(log, q_nominal=factor * log.q_nominal, q_encoder=factor * log.q_encoder)


@pytest.mark.parametrize("command", ["drift", "evaluate", "refresh"])
def test_wrong_data_are_no_fault_of_a_model(of_day_0: Path, tmp_path: Path, command: str) -> None:
    out = ("--out", str(tmp_path / "new.npz")) if command == "refresh" else ()
    line = (command, of_day_0, written(in_deg_and_mm(a_day(1, 0.0)), tmp_path / "deg.parquet"), *out)
    refused = catenary(*line)
    assert refused.code != 0
    said = " ".join(refused.err.split())
    assert "likely numbers in degrees and millimetres; fix: --units deg,mm" in said
    assert "--accept units" in said
    assert not (tmp_path / "new.npz").exists()
    assert catenary(*line, "--units", "deg,mm").code == 0


@pytest.fixture
def tuesday(tmp_path: Path) -> Path:
    """A recording whose J2 is off by almost a millimetre."""
    return Path(written(replace(a_day(1, 0.00098), name="tuesday"), tmp_path / "tuesday.parquet"))


def test_the_command_says_what_moved_since_when_and_the_card_of_what_it_was_made(of_day_0: Path, tuesday: Path) -> None:
    out = tuesday.with_name("new.npz")
    result = catenary("refresh", of_day_0, tuesday, "--out", out)
    assert result.code == 0
    assert "moved: J2 +0.98 mm since 14 May 2026" in result.out
    (entry,) = load_model(out)[1]["refreshed"]
    assert entry["model_sha256"] == sha256_of(of_day_0)
    assert entry["recordings"] == [{"name": "tuesday", "sha256": sha256_of(tuesday)}]
    assert entry["recorded"] == "2026-05-15"
    assert [joint["change"] for joint in entry["joints"]] == ["nothing", "zero and scale"]


def test_a_page_shows_what_is_promised_of_the_rest_of_the_day(of_day_0: Path, tuesday: Path) -> None:
    out, page = (tuesday.with_name(name) for name in ("new.npz", "refresh.html"))
    result = catenary("refresh", of_day_0, tuesday, "--out", out, "--report", page, "--json")
    stated = json.loads(result.out)["joints"]
    rest = a_day(7, 0.00098)
    assert rest.q_encoder is not None
    new = load_model(out)[0]
    rmse = np.sqrt(np.mean((rest.q_encoder - new.calibrate(rest)) ** 2, axis=0)) * [np.rad2deg(1.0), 1e3]
    for joint, true in zip(stated, rmse, strict=True):
        assert 0.9 * joint["rmse_low"] <= true <= 1.1 * joint["rmse_high"]
    text = page.read_text()
    assert "Moved: J2 +0.98 mm since 14 May 2026" in text
    assert "data:image/png" in text
    assert "95 % interval of the RMSE" in text


def test_a_recording_that_the_model_knows_is_refused(of_day_0: Path, tuesday: Path) -> None:
    out = tuesday.with_name("new.npz")
    result = catenary("refresh", of_day_0, of_day_0.with_name("monday.parquet"), "--out", out)
    assert result.code == 2
    assert "expected one of a new day" in result.err
    assert not out.exists()


ZEROS = (0.0, 0.5, 4.0)  # [deg] of J1, by day
NEEDLE = ("--instrument", "SN 4711", "--tool", "needle driver")


def a_rough_day(number: int) -> MotionLog:
    """J1's zero moves from day to day, and on the last the arm is rough."""
    log = cable_arm()
    away = np.deg2rad(ZEROS[number]) * np.array([1.0, 0.0, 0.0])
    rough = np.deg2rad(8.0) * (number == 2) * np.sin(37.0 * log.time)[:, None] * [1.0, 0.0, 0.0]
    return replace(log, q_encoder=log.q_encoder + away + rough, time=log.time + MAY_14 + number * DAY)


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("cards")
    made = []
    for k in range(3):
        write_parquet(a_rough_day(k), folder / f"day{k}.parquet")
        made.append(folder / f"arm{k}.npz")
        done = catenary("fit", folder / f"day{k}.parquet", "--model", "linear", *NEEDLE, "--out", made[-1])
        assert done.code == 0, done
    return made


def test_a_card_keeps_what_a_lab_files_it_by(models: list[Path]) -> None:
    card = json.loads(card_path(models[1]).read_text())
    assert (card["instrument"], card["tool"], card["recorded"]) == ("SN 4711", "needle driver", "2026-05-15")
    assert card["delays"][0]["sure"] == "none"
    assert not {"instrument", "tool", "date"} & set(card["run"])
    facts = dict(catenary("check", models[1], "--json").json["facts"])
    assert (facts["instrument"], facts["recorded"]) == ("SN 4711", "2026-05-15")


def test_cards_are_told_by_date_whatever_their_order(models: list[Path], tmp_path: Path) -> None:
    page = tmp_path / "drift.html"
    order = [models[2], card_path(models[0]), models[1]]
    found = catenary("drift", *order, "--json", "--report", page)
    assert found.code == 1
    stretches = found.json["stretches"]
    assert [each["date"] for each in stretches] == ["2026-05-14", "2026-05-15", "2026-05-16"]
    zeros = np.array([each["zeros"] for each in stretches])
    assert_allclose(zeros[:, 0] - zeros[0, 0], ZEROS, atol=0.05)
    assert found.json["beyond_since"] == {"J1": 2, "J2": None, "J3": None}
    assert {each["tool"] for each in stretches} == {"needle driver"}
    assert all(abs(each["delay"]) < 0.02 for each in stretches)
    text = catenary("drift", *order).out
    assert "J1: beyond since 2026-05-16" in text
    assert "Zeros, added to each joint" in text
    assert "data:image/png" in page.read_text()


def test_a_day_is_given_where_stamps_tell_none_and_a_mended_delay_counts(tmp_path: Path) -> None:
    write_parquet(cable_arm(), tmp_path / "run.parquet")
    options = ("--model", "offset", "--delay", "0.02", "--accept", "delay", "--out")
    model = tmp_path / "run.npz"
    assert catenary("fit", tmp_path / "run.parquet", "--date", "2026-05-14", *options, model).code == 0
    (only, again) = catenary("drift", model, model, "--json").json["stretches"]
    assert only == again
    assert only["date"] == "2026-05-14"
    assert only["delay"] == pytest.approx(0.0, abs=0.01)
    assert "expected a day such as 2026-05-14" in refusal(
        "fit", tmp_path / "run.parquet", "--date", "14.5.26", *options, model
    )


def test_what_does_not_belong_together_is_refused(models: list[Path], tmp_path: Path) -> None:
    assert "do not go with models" in refusal("drift", models[0], models[1], "--delay", "0.1")
    log = cable_arm()
    write_parquet(replace(log, joint_names=("a", "b", "c")), tmp_path / "other.parquet")
    catenary("fit", tmp_path / "other.parquet", "--model", "offset", "--out", tmp_path / "other.npz")
    assert "expected those of arm0" in refusal("drift", models[0], tmp_path / "other.npz")


def test_an_identified_arm_is_told_what_has_changed_since(tmp_path: Path) -> None:
    arm, runs = load_robot("raven2"), []
    for seed, zero, rubs in ((0, 0.0, 0.0), (1, 2.0, 0.0), (2, 0.0, 1.5), (3, 0.0, 0.0)):
        log = recorded(arm, seed, noise=0.02)
        changed = np.array(log.tau) + np.array([0.0, zero, 0.0]) + np.array([0.0, rubs, 0.0]) * np.sign(log.qd)
        write_npz(replace(log, tau=changed), tmp_path / f"run{seed}.npz")
        runs.append(tmp_path / f"run{seed}.npz")
    found = tmp_path / "arm.npz"
    catenary("identify", runs[0], "--robot", "raven2", "--friction", "none", "--no-prior", "--out", found)
    outcome = catenary("drift", found, *runs[1:], "--json")
    assert outcome.code == 1
    told = [(change["recording"], change["finding"], change["joints"]) for change in outcome.json["changes"]]
    assert told == [("run1", "offset", ["elbow"]), ("run2", "friction", ["elbow"])]
    assert "no difference" in catenary("drift", found, runs[3]).out
