"""Intervals about the calibrated joints of a da Vinci arm, on later blocks and on other recordings."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import Evaluation, evaluate
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.recordings import error_limits
from catenary.plant import MotionLog
from catenary.recording.logs import read_log

TRAININGS = ("random_train", "insertion_train", "peg_transfer_train", "sampled_train")
MAX_ERROR = (2.0, 2.0, 5.0, 60.0, 60.0, 70.0)  # deg, mm; the recordings' README, caveat 3
KINDS = {"play": FitOptions(kind="linear", play=PLAY_SHARES), "learned": FitOptions()}


@cache
def log_of(folder: Path, name: str) -> MotionLog:
    return read_log(folder / "dvrk_calibration_berkeley" / f"{name}.npz")


@cache
def early(folder: Path, name: str, kind: str) -> FitResult:
    return fit_logs([log_of(folder, name)], KINDS[kind], FitRun(held_out=0.2, max_error=MAX_ERROR))


def on_the_rest(fitted: FitResult) -> Evaluation:
    assert fitted.held_out is not None
    return fitted.held_out


@pytest.mark.parametrize("kind", KINDS)
def test_intervals_hold_on_later_blocks_of_the_same_recording(recordings: Path, kind: str) -> None:
    names = TRAININGS if kind == "play" else ("insertion_train", "peg_transfer_train")
    found = [on_the_rest(early(recordings, name, kind)) for name in names]
    held = np.array([[joint.coverage for joint in evaluation.joints] for evaluation in found])
    # 90 % asked; the wrist's errors grow towards the end of sampled_train
    assert np.mean(held >= 0.85) >= 0.9
    assert (held >= 0.8).all()
    assert 0.85 <= np.median(held) <= 0.97
    assert not any("too narrow" in coverage_verdicts(evaluation) for evaluation in found)


def test_intervals_that_do_not_hold_on_another_recording_are_called_too_narrow(recordings: Path) -> None:
    fitted = early(recordings, "random_train", "play")
    verdicts = {}
    for name in TRAININGS[1:]:
        log = log_of(recordings, name)
        rows = calibration_data([log], fitted.model.features, max_error=error_limits(MAX_ERROR, log))
        tested = evaluate(fitted.model, rows)
        for joint, verdict in zip(tested.joints, coverage_verdicts(tested), strict=True):
            assert (verdict == "held") == (joint.coverage >= 0.85)
            verdicts[name, joint.name] = verdict
    # the camera's registration shifts between days: at the level of J1 to J3
    assert "too narrow" in verdicts.values()


@pytest.mark.parametrize("tool", ["4LPitch4", "4LRoll2", "4LRoll3"])
def test_errors_and_shares_of_runs_under_other_loads_are_those_stated(recordings: Path, tool: str) -> None:
    """A tool's zero differs from load to load: without it, 89 to 94 % were stated, and 66 to 79 % true."""
    runs = [read_log(path) for path in sorted((recordings / "davinci_tools").glob(f"{tool}_*.npz"))]
    result = fit_logs(runs[::2], FitOptions(), FitRun(accept=("delay", "scale")))
    (stated,) = result.spread
    (joint,) = evaluate(result.model, calibration_data(runs[1::2], result.model.features)).joints
    assert stated.rmse_low is not None
    assert stated.rmse_high is not None
    assert stated.held_low is not None
    assert stated.held_high is not None
    assert 0.95 * stated.rmse_low <= joint.rmse <= 1.05 * stated.rmse_high
    assert stated.held_low - 0.05 <= joint.coverage <= stated.held_high + 0.05
    assert any(note.startswith("zeros of recordings differ by J1") for note in result.notes)
