"""catenary drift over cards: what a lab keeps of its models, by date."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.files import card_path
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from command_line import catenary, refusal
from tests.verdict.test_delay import cable_arm

MAY_14, DAY = 1778716800.0, 86400.0  # [s since 1970] midnight of 14 May 2026, UTC
ZEROS = (0.0, 0.5, 4.0)  # [deg] of J1, by day
NEEDLE = ("--instrument", "SN 4711", "--tool", "needle driver")


def a_day(number: int) -> MotionLog:
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
        write_parquet(a_day(k), folder / f"day{k}.parquet")
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
    assert "Zeros: what is added to each joint" in text
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
