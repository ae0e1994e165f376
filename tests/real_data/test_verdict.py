"""The verdict on recordings of a real arm: untouched ones pass, spoilt copies are refused or named."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from catenary.plant import MotionLog
from catenary.recording.logs import read_log
from catenary.verdict.check import findings_of
from spoilt import SPOILS, Spoil

SPOILT = ("random_train", "insertion_train", "peg_transfer_train")
UNTOUCHED = (*SPOILT, "sampled_train", *(f"error_exp{k}" for k in range(1, 6)))
WINDOWS_S, POSE_S = (30.0, 60.0, 120.0, 300.0), 0.4  # [s] of windows, and of a pose where no time was recorded
EXAMPLES_OF_WINDOWS, LEAST_ROWS = 150, 40


@cache
def log_of(folder: Path, name: str) -> MotionLog:
    return read_log(folder / "dvrk_calibration_berkeley" / f"{name}.npz")


@pytest.mark.parametrize("name", UNTOUCHED)
def test_an_untouched_recording_passes(recordings: Path, name: str) -> None:
    assert [str(f) for f in findings_of(log_of(recordings, name)) if f.refuses] == []


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.slow)])  # thresholds were set on even ones
def test_untouched_windows_pass_but_where_too_short(recordings: Path, seed: int) -> None:
    rng, refused = np.random.default_rng(seed), []
    for _ in range(EXAMPLES_OF_WINDOWS):
        log = log_of(recordings, UNTOUCHED[rng.integers(len(UNTOUCHED))])
        step = POSE_S if log.time is None else float(np.median(np.diff(log.time)))
        rows = min(round(float(rng.choice(WINDOWS_S)) / step), len(log))
        first = int(rng.integers(0, len(log) - rows + 1))
        window = log.part(first, first + rows)
        names = {each.name for each in findings_of(window) if each.refuses}
        refused += [(log.name, first, rows, names)] * bool(names and window.ok.sum() >= LEAST_ROWS)
    assert refused == []


@pytest.mark.slow
@pytest.mark.parametrize("name", SPOILT)
@pytest.mark.parametrize("spoil", SPOILS, ids=lambda s: f"{s.kind}: {s.says}")
def test_a_spoilt_copy_is_refused_or_named(recordings: Path, spoil: Spoil, name: str) -> None:
    found = {f.name for f in findings_of(spoil.spoil(log_of(recordings, name))) if f.refuses == spoil.refused}
    assert found & set(spoil.named)


def test_outliers_of_a_camera_are_notes_with_limits_offered(recordings: Path) -> None:
    notes = [f for f in findings_of(log_of(recordings, "random_train")) if f.name == "outliers"]
    assert notes
    assert all(f.remedy.startswith("--max-error ") and not f.refuses for f in notes)
