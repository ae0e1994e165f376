"""Rows that a fit leaves out are counted by joint, and the error with them is told."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.plant import MotionLog
from catenary.verdict.corrections import Mend, left_out_rows
from tests.verdict.test_delay import cable_arm

LINEAR = FitOptions(kind="linear")
SIZE = np.array([np.rad2deg(1.0), np.rad2deg(1.0), 1e3])
FAR = (9.0, 9.0, 9.0)  # deg, deg, mm


def wild(joint: int, every: int = 100) -> MotionLog:
    log = cable_arm()
    seen = log.q_encoder.copy()
    seen[7::every, joint] += 20.0 / SIZE[joint]
    return replace(log, q_encoder=seen)


def findings(result: FitResult) -> list[str]:
    return [note for note in result.notes if note.startswith("dropped: ")]


@pytest.mark.alike
@pytest.mark.parametrize("joint", range(3))
def test_failures_of_one_joint_are_counted_there_and_found(joint: int) -> None:
    log = wild(joint)
    result = fit_logs([log], LINEAR, FitRun(max_error=FAR, folds=0))
    rows = len(range(7, len(log), 100))
    assert any(f"{rows} beyond the error limit ({log.joint_names[joint]} {rows})" in note for note in result.notes)
    (said,) = findings(result)
    # independently: every row of the recording, corrected by the model
    left = SIZE * (log.q_encoder - result.model.calibrate(log))
    for name, with_them in zip(log.joint_names, np.sqrt(np.mean(left**2, axis=0)), strict=True):
        told = re.search(rf"{name} [^ ]+ \(([^)]+)\)", said)
        assert told is not None
        assert_allclose(float(told[1]), with_them, rtol=6e-3)  # three digits


def test_rows_like_the_others_that_were_left_out_are_no_finding() -> None:
    assert findings(fit_logs([Mend(leave_out=("1000:1300",))(cable_arm())], LINEAR)) == []


def test_a_true_error_that_was_cut_away_is_found() -> None:
    """Far from the middle the arm bends; limits that cut that off make a good number of a bad model."""
    log = cable_arm()
    bent = log.q_encoder + 0.6 * np.maximum(np.abs(log.q_nominal) - 0.35, 0.0) * [1.0, 0.0, 0.0]
    result = fit_logs([replace(log, q_encoder=bent)], LINEAR, FitRun(max_error=(2.5, 9.0, 9.0)))
    assert any("J1" in said for said in findings(result))


def test_rows_that_were_not_measured_are_not_among_those_left_out() -> None:
    log = cable_arm()
    ok = np.arange(len(log)) % 2 == 0
    seen = np.where(ok[:, None], log.q_encoder, 77.0)
    mended = Mend(leave_out=("10:20,30:40",))(replace(log, ok=ok, q_encoder=seen))
    assert np.flatnonzero(left_out_rows(mended)).tolist() == [10, 12, 14, 16, 18, 30, 32, 34, 36, 38]
