from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import simulated_arm
from catenary.calibration.files import save_model
from catenary.calibration.fit import FitOptions
from catenary.calibration.fitting import FitRun
from catenary.errors import InputError
from catenary.recording.logs import write_parquet
from catenary.workflows.fit import evaluate_calibration, evaluation_summary, fit_calibration
from recordings import recording

LINEAR = FitOptions(kind="linear")


@pytest.fixture
def recording_path(tmp_path: Path) -> Path:
    return simulated_arm.write(tmp_path / "run.npz")


def fitted_to(recording: Path, folder: Path) -> Path:
    """The file of a linear model."""
    result = fit_calibration([recording], LINEAR)
    save_model(result.model, result.card, folder / "model.npz")
    return folder / "model.npz"


def test_a_linear_fit_recovers_a_linear_error(recording_path: Path, tmp_path: Path) -> None:
    model = fitted_to(recording_path, tmp_path)
    other = simulated_arm.write(tmp_path / "other.npz", seed=0, noise=0.0)
    for joint in evaluate_calibration(model, [other]).evaluation.joints:
        assert joint.rmse < 1e-2 * joint.offset_rmse  # what noise of 0.1 mrad and 0.1 mm leaves


def test_held_out_errors_are_those_of_evaluating_the_same_rows(recording_path: Path, tmp_path: Path) -> None:
    result = fit_calibration([recording_path], LINEAR, FitRun(held_out=0.25))
    save_model(result.model, result.card, tmp_path / "model.npz")
    late = {key: np.array(values)[300:] for key, values in simulated_arm.arrays().items() if key != "units"}
    np.savez(tmp_path / "late.npz", **late)
    evaluation = evaluate_calibration(tmp_path / "model.npz", [tmp_path / "late.npz"]).evaluation
    assert result.held_out is not None
    assert evaluation.joints == result.held_out.joints


def test_the_held_out_part_is_not_fitted_to(tmp_path: Path) -> None:
    early = simulated_arm.arrays()
    changed = early["q_act"].copy()
    changed[300:] += 1.0
    paths = [simulated_arm.write(tmp_path / "a.npz"), simulated_arm.write(tmp_path / "b.npz", q_act=changed)]
    run = FitRun(held_out=0.25, folds=0, accept=("jump",))
    one, other = (fit_calibration([path], LINEAR, run).model for path in paths)
    X, q = early["q_des"], early["q_des"]
    assert_allclose(one.correction(X, q), other.correction(X, q), atol=0.0)


def test_the_card_holds_the_held_out_errors(recording_path: Path) -> None:
    result = fit_calibration([recording_path], LINEAR, FitRun(held_out=0.25))
    assert result.held_out is not None
    assert result.card["errors"]["held_out"] == [asdict(joint) for joint in result.held_out.joints]
    expected = {"seed": 0, "held_out": 0.25, "folds": 5, "max_error": None, "accept": [], "coverage": 0.9}
    assert result.card["run"] == expected


def test_several_recordings_are_fitted_together(recording_path: Path, tmp_path: Path) -> None:
    other = simulated_arm.write(tmp_path / "other.npz", seed=1, rows=200)
    result = fit_calibration([recording_path, other], LINEAR)
    assert len(result.data) == 600
    assert [source["name"] for source in result.card["data"]] == ["run", "other"]


def test_progress_ends_at_one(recording_path: Path) -> None:
    told: list[float] = []
    fit_calibration([recording_path], FitOptions(kind="offset"), progress=told.append)
    assert told[-1] == 1.0
    assert told == sorted(told)


@pytest.mark.parametrize(
    ("key", "place", "value", "note"),
    [
        ("ok", slice(10, 30), False, "run: left out 20 without measurement, 3 without 3 previous commands, of 400 rows"),
        ("q_act", (5, 1), 3.0, "run: J2: 1 of 400 errors lie beyond 10 robust standard deviations"),
        (("q_des", "q_act"), (slice(None), 2), 0.1, "run: J3: never moved; a model holds only where it stood"),
    ],
)  # fmt: skip
def test_what_looks_wrong_is_noted(tmp_path: Path, key: Any, place: Any, value: float, note: str) -> None:
    arrays = simulated_arm.arrays()
    for each in (key,) if isinstance(key, str) else key:
        arrays[each][place] = value
    np.savez(tmp_path / "run.npz", **arrays)
    notes = fit_calibration([tmp_path / "run.npz"], FitOptions(kind="linear", history=3)).notes
    assert any(said.startswith(note) for said in notes)


def test_a_recording_used_in_training_is_known_by_its_content(recording_path: Path, tmp_path: Path) -> None:
    model = fitted_to(recording_path, tmp_path)
    copy = tmp_path / "another_name.npz"
    copy.write_bytes(recording_path.read_bytes())
    other = simulated_arm.write(tmp_path / "other.npz", seed=1)
    assert evaluate_calibration(model, [other, copy]).seen_in_training == ("another_name",)


def test_a_summary_of_simulated_data_says_so(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_parquet(recording(np.random.default_rng(0), simulated=True), path)
    result = evaluate_calibration(fitted_to(path, tmp_path), [path])
    assert evaluation_summary(result)["simulated"] is True


def test_no_recordings_are_refused(recording_path: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one recording"):
        fit_calibration([], LINEAR)
    with pytest.raises(InputError, match="at least one recording"):
        evaluate_calibration(fitted_to(recording_path, tmp_path), [])
