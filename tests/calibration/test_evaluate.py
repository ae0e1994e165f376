from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.dataset import CalibrationData
from catenary.calibration.evaluate import Evaluation, cross_validate, evaluate, rms
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model import CalibrationModel
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.parallel import Progress
from catenary.plant import MotionLog
from recordings import data_of, fitted, recording


def off_by(errors: Any, **changes: Any) -> MotionLog:
    """One turning and one sliding joint, off by the errors (N, 2) in rad and m."""
    values = np.asarray(errors, dtype=float)
    return recording(np.random.default_rng(0), rows=len(values), units=("rad", "m"), error=lambda _: values, **changes)


def offset_model(*errors: float) -> CalibrationModel:
    """Corrects by fixed offsets, fitted to the motion of off_by."""
    return fitted(off_by(np.tile(errors, (40, 1))), kind="offset")


def judged(model: CalibrationModel, log: MotionLog, **options: Any) -> Evaluation:
    return evaluate(model, data_of(log, inputs=model.features.signals), **options)


def test_errors_are_in_deg_and_mm_and_those_of_paper_and_pencil() -> None:
    # offset 1 mm; errors 4 mm and -3 mm: raw 3.54 and 4, after the offset 3 and -4: 3.54 and 4
    errors = np.full((40, 2), np.deg2rad(3.0))
    errors[::2, 1], errors[1::2, 1] = 0.004, -0.003
    turning, sliding = judged(offset_model(0.0, 0.001), off_by(errors)).joints
    assert (turning.unit, sliding.unit, sliding.n) == ("deg", "mm", 40)
    assert (turning.raw_rmse, turning.raw_max) == pytest.approx((3.0, 3.0))
    assert (sliding.raw_rmse, sliding.raw_max) == pytest.approx((np.sqrt(12.5), 4.0))
    assert (sliding.offset_rmse, sliding.offset_max) == pytest.approx((np.sqrt(12.5), 4.0))
    assert sliding.max == pytest.approx(4.0)  # -4 mm counts by its size


def test_raw_offset_and_model_are_judged_on_the_same_rows() -> None:
    log = recording(np.random.default_rng(2), rows=60, ok=np.arange(60) % 7 != 0)
    model = fitted(log, kind="linear")
    evaluation = evaluate(model, data_of(log))
    usable = np.flatnonzero(log.ok)
    raw = (log.q_encoder - log.q_nominal)[usable]
    assert_array_equal(evaluation.raw, raw)
    assert_allclose(evaluation.after_offset, raw - raw.mean(axis=0), atol=1e-15)
    assert_allclose(evaluation.after_model, (log.q_encoder - model.calibrate(log))[usable], atol=1e-15)
    assert {joint.n for joint in evaluation.joints} == {len(usable)}
    left, first = np.rad2deg(evaluation.after_model[:, 0]), evaluation.joints[0]
    assert (first.rmse, first.max) == pytest.approx((rms(left), np.abs(left).max()))
    assert first.percent_of_offset == pytest.approx(100.0 * first.rmse / first.offset_rmse)


def test_rows_outside_the_valid_range_have_the_error_after_the_offset_and_are_counted() -> None:
    log = recording(np.random.default_rng(3), rows=100)
    q = log.q_nominal.copy()
    q[:25] += 9.0
    evaluation = judged(fitted(log, kind="linear"), replace(log, q_nominal=q))
    assert [joint.outside_valid_range for joint in evaluation.joints] == [0.25] * 3
    assert_array_equal(evaluation.after_model[:25], evaluation.after_offset[:25])


@pytest.mark.parametrize(
    ("time", "unit", "stretches"),
    [
        (100.0 + np.arange(25.0), "s", [(100, 110, 10), (110, 120, 10), (120, 130, 5)]),
        (np.arange(21.0), "s", [(0, 10, 10), (10, 20, 11)]),
        (np.r_[0.0:10.0, 50.0:60.0], "s", [(0, 10, 10), (50, 60, 10)]),
        (None, "rows", [(0, 10, 10), (10, 20, 10), (20, 30, 1)]),
    ],
    ids=["the clock", "the last row belongs to the window that it ends", "none without a row", "rows"],
)
def test_windows_of_a_given_length_follow(time: Any, unit: str, stretches: list[Any]) -> None:
    log = off_by(np.zeros((21 if time is None else len(time), 2)), time=time)
    evaluation = judged(offset_model(0.0, 0.0), log, window=10.0)
    assert evaluation.window_unit == unit
    assert [(round(w.start, 6), round(w.end, 6), w.n) for w in evaluation.windows] == stretches


RUN = recording(np.random.default_rng(5))
SLIDING = recording(np.random.default_rng(6), units=("rad", "m"))
ONE_INPUT = {"inputs": ("q:J1",)}


@pytest.mark.parametrize(
    ("data", "window", "message"),
    [
        *[(lambda: data_of(RUN), length, "window: expected a pos") for length in (0.0, -1.0, float("nan"))],
        (lambda: data_of(RUN, play=(0.1,)), None, r"data: holds q:J1, .*play\(q:J1.*; the model takes q:J1$"),
        (lambda: data_of(SLIDING, **ONE_INPUT), None, r"has joints J1 \[rad\], J2 \[m\]; the model is for J1 \[rad\]"),
        (lambda: data_of(RUN).rows(np.zeros(300, dtype=bool)), None, "data: no row"),
    ],
)
def test_data_and_windows_that_say_nothing_are_refused(data: Any, window: Any, message: str) -> None:
    options = {} if "holds" not in message else ONE_INPUT
    with pytest.raises(InputError, match=message):
        evaluate(fitted(RUN, **options), data(), window=window)


def offset_fit(
    log: MotionLog, seen: Callable[[CalibrationData], object] = id
) -> Callable[[CalibrationData, Progress], CalibrationModel]:
    """Fit of a fixed offset; `seen` is told the rows."""
    options = FitOptions("offset")
    inputs = choose_inputs(Recordings.of([log]), options)

    def fit_rows(rows: CalibrationData, progress: Progress) -> CalibrationModel:
        seen(rows)
        return fit_model(rows, inputs, options, progress=progress)

    return fit_rows


def test_no_fold_is_fitted_to_the_block_that_it_predicts() -> None:
    logs = [off_by(np.random.default_rng(8).normal(size=(53, 2))), off_by(np.ones((40, 2)))]
    data, seen = data_of(logs[0]), []
    cross_validate(data, offset_fit(logs[0], seen.append), folds=5)
    blocks = [set(part) for part in np.split(data.time, np.flatnonzero(np.diff(data.blocks(5))) + 1)]
    assert [set(rows.time) for rows in seen] == [set(data.time) - block for block in blocks]
    seen.clear()
    cross_validate(data_of(logs[1], logs[1]), offset_fit(logs[1], seen.append), folds=4)
    assert_array_equal([np.bincount(rows.recording) for rows in seen], np.full((4, 2), 30))


def test_zeros_of_recordings_are_those_that_the_others_do_not_tell() -> None:
    zeros = (0.0, 0.03, 0.0, 0.05)
    logs = [off_by(np.full((40, 2), zero)) for zero in zeros]
    found = cross_validate(data_of(*logs), offset_fit(logs[0]), folds=4)
    of_others = [zero - (sum(zeros) - zero) / 3.0 for zero in zeros]
    assert_allclose(found.of_others, np.repeat(of_others, 40)[:, None] * np.ones(2), atol=1e-12)
    assert_allclose(found.after_model, np.repeat(np.array(zeros) - 0.02, 40)[:, None] * np.ones(2), atol=1e-12)
    assert_array_equal(found.stretch, found.recording)
    two = cross_validate(data_of(*logs[:2]), offset_fit(logs[0]), folds=4)  # of which none tells an own zero
    assert_array_equal(two.of_others, two.after_model)
    assert_array_equal(two.stretch, two.block)


def test_spread_over_blocks_is_that_of_their_errors_about_the_others_mean() -> None:
    errors = np.random.default_rng(9).normal(size=(60, 2))
    spread = cross_validate(data_of(off_by(errors)), offset_fit(off_by(errors)), folds=4).spread
    expected = []
    for block in np.split(np.arange(60), 4):
        others = np.delete(errors[:, 1], block).mean()
        expected.append(1000.0 * np.sqrt(np.mean((errors[block, 1] - others) ** 2)))
    sliding = spread[1]
    assert (sliding.joint, sliding.unit, sliding.folds) == ("J2", "mm", 4)
    for mean, sd in ((sliding.rmse_mean, sliding.rmse_sd), (sliding.offset_rmse_mean, sliding.offset_rmse_sd)):
        assert mean == pytest.approx(np.mean(expected))
        assert sd == pytest.approx(np.sqrt(np.sum((expected - np.mean(expected)) ** 2) / 3.0))


@pytest.mark.parametrize(
    ("rows", "folds", "message"),
    [
        *[((range(40),), folds, "folds: expected 2 to 40") for folds in (-1, 0, 1, 41)],
        (((0,), (1,), (2,)), 2, "folds: 2 blocks leave no rows to fit to, 3 rows in all"),
    ],
)
def test_number_of_folds_that_leaves_nothing_is_refused(rows: Any, folds: int, message: str) -> None:
    logs = [off_by(np.zeros((40, 2)), ok=np.isin(np.arange(40), list(each))) for each in rows]
    with pytest.raises(InputError, match=message):
        cross_validate(data_of(*logs), offset_fit(logs[0]), folds=folds)
