import json
import re
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.recording.logs import read_log, write_parquet
from command_line import catenary, refusal


def fit_json(data: Path, *options: object) -> Any:
    """Fit to a recording, into out.npz beside it."""
    outcome = catenary("fit", data, "--out", data.with_name("out.npz"), "--json", *options)
    assert outcome.code == 0, outcome
    return outcome.json


def evaluate_json(model: Path, *arguments: object) -> Any:
    outcome = catenary("evaluate", model, *arguments, "--json")
    assert outcome.code == 0, outcome
    return outcome.json


def test_fit_writes_a_model_and_its_card_and_tells_its_error_on_unseen_data(tmp_path: Path, run: Path) -> None:
    content = fit_json(Path(copy(run, tmp_path)), "--model", "linear", "--held-out", "0.25")
    assert content["kind"] == "linear"
    assert content["rows"] == 300
    assert content["inputs"] == ["q:J1", "q:J2", "q:J3"]
    assert [joint["joint"] for joint in content["cross_validation"]] == ["J1", "J2", "J3"]
    assert [joint["n"] for joint in content["held_out"]] == [100, 100, 100]
    card = json.loads((tmp_path / "out.card.json").read_text())
    assert (card["kind"], card["rows"]) == ("linear", 300)
    outcome = catenary("fit", run, "--model", "linear", "--out", tmp_path / "m.npz", "--held-out", "0.2")
    assert "RMSE on data that the fit did not see" in outcome.out
    assert "RMSE and largest error on the held-out part" in outcome.out


def test_evaluate_as_json_has_the_documented_keys(model: Path, run: Path) -> None:
    content = evaluate_json(model, run, "--window", "5")
    assert [joint["unit"] for joint in content["joints"]] == ["deg", "deg", "mm"]
    for joint in content["joints"]:
        assert {"name", "n", "raw_rmse", "offset_rmse", "rmse", "max", "outside_valid_range"} <= set(joint)
        assert joint["n"] == 400
    assert content["seen_in_training"] == ["run"]
    assert [round(window["start"]) for window in content["windows"]] == [0, 5, 10]
    part = run.with_name("part.parquet")
    write_parquet(replace(read_log(run).part(150, 300), name="part", sha256=None), part)
    for name, path in (("run", run), ("part", part)):
        assert f"{name}: the model was fitted to rows of this recording" in catenary("evaluate", model, path).err


def test_tables_are_printed_for_latex_and_nothing_else(model: Path, run: Path, tmp_path: Path) -> None:
    printed = catenary("evaluate", model, run, "--latex", "--report", tmp_path / "page.html").out
    tables = printed.strip().split("\n\n")
    assert len(tables) == 3  # errors, coverage, windows
    for table in tables:
        assert table.startswith(r"\begin{tabular}")
        assert table.endswith("\\bottomrule\n\\end{tabular}")
    rows = tables[0].partition(r"\midrule")[2].partition(r"\bottomrule")[0].strip().splitlines()
    assert [row.partition(" & ")[0] for row in rows] == ["J1", "J2", "J3"]
    assert len({row.count("&") for row in rows}) == 1
    assert r"of fixed offset [\%]" in tables[0]
    assert not re.search(r"(?<!\\)[%#_]", printed.replace(r"\\", ""))
    fitted = catenary("fit", run, "--model", "offset", "--out", tmp_path / "m.npz", "--latex").out
    assert "\n\n".join(re.findall(r"(?s)\\begin{tabular}.*?\\end{tabular}", fitted)) == fitted.strip()
    assert "--latex: does not go with --json" in catenary("evaluate", model, run, "--latex", "--json").err


def test_evaluate_tells_whether_intervals_hold(tmp_path: Path, model: Path) -> None:
    other = simulated_arm.write(tmp_path / "other.npz", seed=1)
    intervals = evaluate_json(model, other)["intervals"]
    assert intervals["coverage_asked"] == 0.9
    before = intervals["joints"]
    assert all((joint["verdict"] == "held") == (joint["coverage"] >= 0.85) for joint in before)
    out = catenary("evaluate", model, other).out
    assert "Errors within the model's intervals, nominal coverage 90 %" in out
    arrays = simulated_arm.arrays(seed=1)
    arrays["q_act"][:, 0] += np.deg2rad(30.0)  # a cable has slipped
    np.savez(tmp_path / "slipped.npz", **arrays)
    slipped, *others = evaluate_json(model, tmp_path / "slipped.npz")["intervals"]["joints"]
    assert (slipped["coverage"], slipped["verdict"]) == (0.0, "too narrow")
    assert others == before[1:]
    assert "too narrow" in catenary("evaluate", model, tmp_path / "slipped.npz").out


def test_inputs_are_chosen_per_joint(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz", tau=np.zeros((400, 3)))
    fit_json(path, "--model", "linear", "--inputs", "J1=q:J1,tau:J1;J2=q;J3=q:J3")
    joints = json.loads((tmp_path / "out.card.json").read_text())["joints"]
    chosen = [sorted(joint["inputs"]) for joint in joints]
    assert chosen == [["q:J1", "tau:J1"], ["q:J1", "q:J2", "q:J3"], ["q:J3"]]


@pytest.mark.usefixtures("undrawn")
def test_pages_say_what_was_tested_on(model: Path, run: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert catenary("evaluate", model, run, "--report", page).out.endswith(f"page:  {page}\n")
    assert "no test: the model was fitted to run" in page.read_text()
    catenary("fit", run, "--model", "offset", "--out", tmp_path / "m.npz", "--report", page)
    assert "the data that it was fitted to" in page.read_text()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q_act": np.full((400, 3), np.nan)}, "no usable row: q_encoder is measured on none"),
        ({"ok": np.zeros(400, dtype=bool)}, "no usable row: ok is set on none that has q_encoder"),
        ({"rows": 11}, "with one of 5 blocks left out 8 remain"),
    ],
)
def test_a_recording_that_is_none_is_refused(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    path = simulated_arm.write(tmp_path / "run.npz", **changes)
    assert words in refusal("fit", path, "--model", "linear", "--out", tmp_path / "out.npz")
    assert not (tmp_path / "out.npz").exists()


def test_a_model_that_does_harm_on_what_was_held_out_is_warned_of(tmp_path: Path) -> None:
    arrays = simulated_arm.arrays(seed=1)
    late = slice(int(0.8 * len(arrays["q_des"])), None)
    arrays["q_des"][late, 0] += 2.0  # where J1 never was
    arrays["q_act"][late, 0] += 2.0
    np.savez(tmp_path / "day.npz", **arrays)
    line = ("fit", tmp_path / "day.npz", "--model", "linear", "--held-out", 0.2, "--out", tmp_path / "m.npz")
    outcome = catenary(*line, *(word for name in ("units", "scale") for word in ("--accept", name)))
    assert outcome.code == 0, outcome.err
    assert "warning: J1: " in outcome.err
    assert "note: warning" not in outcome.err


def test_what_the_verdict_advises_of_large_errors_every_command_takes(run: Path, model: Path, tmp_path: Path) -> None:
    arrays = simulated_arm.arrays(seed=3)
    arrays["q_act"][100:110] = 0.0
    spoilt = tmp_path / "spoilt.npz"
    np.savez(spoilt, **arrays)
    advice = catenary("check", spoilt)
    assert advice.code == 1
    _, _, limits = advice.out.partition("--max-error ")
    option = ("--max-error", limits.split()[0])
    assert "zeros" not in catenary("check", spoilt, *option).out
    for command in (("evaluate", model), ("drift", model), ("refresh", model, "--out", tmp_path / "new.npz")):
        line = (command[0], command[1], spoilt, *command[2:])
        assert "zero on every joint" in refusal(*line)
        assert "zero on every joint" not in catenary(*line, *option).err


def test_a_model_s_mends_are_told_and_switched_off_on_the_command_line(tmp_path: Path) -> None:
    for seed in (0, 1):
        arrays = simulated_arm.arrays(seed=seed)
        arrays["q_act"][:, 0] *= -1.0
        np.savez(tmp_path / f"{seed}.npz", **arrays)
    made = tmp_path / "m.npz"
    assert catenary("fit", tmp_path / "0.npz", "--sign", "J1", "--model", "linear", "--out", made).code == 0
    done = catenary("evaluate", made, tmp_path / "1.npz")
    assert "corrected as the model's training data: --sign q_encoder:J1; --as-is disables this" in " ".join(
        done.err.split()
    )
    assert "--sign J1" in refusal("evaluate", made, tmp_path / "1.npz", "--as-is")
