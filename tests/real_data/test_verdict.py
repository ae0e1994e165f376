"""The verdict on recordings of a real arm: untouched ones pass, spoilt copies are refused or named."""

from functools import cache
from pathlib import Path

import pytest

from catenary.plant import MotionLog
from catenary.recording.logs import read_log
from catenary.verdict.check import findings_of
from spoilt import SPOILS, Spoil

SPOILT = ("random_train", "insertion_train", "peg_transfer_train")
UNTOUCHED = (*SPOILT, "sampled_train", *(f"error_exp{k}" for k in range(1, 6)))


@cache
def log_of(folder: Path, name: str) -> MotionLog:
    return read_log(folder / "dvrk_calibration_berkeley" / f"{name}.npz")


@pytest.mark.parametrize("name", UNTOUCHED)
def test_an_untouched_recording_passes(recordings: Path, name: str) -> None:
    assert [str(f) for f in findings_of(log_of(recordings, name)) if f.refuses] == []


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
