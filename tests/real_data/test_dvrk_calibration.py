"""Calibration of a da Vinci arm whose joints a camera measured; see its README beside the recordings."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal, assert_array_less

from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.evaluate import JointErrors, evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_recordings import fit_logs
from catenary.calibration.fit_rows import Inputs, choose_inputs, fit_model
from catenary.calibration.recordings import Recordings
from catenary.plant import MotionLog
from catenary.recording.logs import read_log
from tests.truth.recordings import data_folder

FOLDER = data_folder() / "dvrk_calibration_berkeley"
SHOWN = np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0, *[180.0 / np.pi] * 3])  # deg, deg, mm, deg, deg, deg
MAX_ERROR = np.array([2.0, 2.0, 5.0, 60.0, 60.0, 70.0]) / SHOWN  # README, caveat 3

pytestmark = pytest.mark.skipif(
    not FOLDER.is_dir(), reason=f"no recordings in {FOLDER}; set CATENARY_DATA to the folder that holds them"
)

KINDS: dict[str, dict[str, Any]] = {
    "offset": {"kind": "offset"},
    "linear": {"kind": "linear"},
    "polynomial": {"kind": "polynomial"},
    "neural paper": {"kind": "neural", "preset": "paper"},
    "learned": {"kind": "learned"},
}
SLOW = pytest.mark.slow
KINDS_BY_TIME = [pytest.param(kind, marks=SLOW if "neural" in kind else ()) for kind in KINDS]


@cache
def recording(name: str) -> MotionLog:
    return read_log(FOLDER / f"{name}.npz")


def prepared(name: str, options: FitOptions, held_out: float = 0.0) -> tuple[CalibrationData, Inputs]:
    log = recording(name)
    inputs = choose_inputs(Recordings.of([log]), options, held_out=held_out)
    return calibration_data([log], inputs.features), inputs


@cache
def errors_on_the_last_fifth(kind: str) -> tuple[JointErrors, ...]:
    """Trained on the first 80 % of the random motion, tested on the rest."""
    options = FitOptions(**KINDS[kind])
    data, inputs = prepared("random_train", options, held_out=0.2)
    early, late = data.split_by_time(0.2)
    return evaluate(fit_model(early, inputs, options), late).joints


def rmse(errors: tuple[JointErrors, ...]) -> np.ndarray:
    return np.array([joint.rmse for joint in errors])


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "index"), [("J3", 2), ("J5", 4), ("J6", 5)])
def test_the_learner_beats_the_papers_network_where_the_cables_show(joint: str, index: int) -> None:
    best, paper = errors_on_the_last_fifth("learned"), errors_on_the_last_fifth("neural paper")
    assert best[index].name == joint
    assert best[index].rmse < paper[index].rmse


@pytest.mark.parametrize("kind", KINDS_BY_TIME)
def test_every_model_beats_the_offset_on_the_insertion_or_is_one(kind: str) -> None:
    third = errors_on_the_last_fifth(kind)[2]
    assert (third.rmse == third.offset_rmse) if kind == "offset" else (third.rmse < third.offset_rmse)


@cache
def errors_on_other_motion(kind: str) -> tuple[JointErrors, ...]:
    """Trained on a peg transfer, tested on points all over the range: where extrapolation must be noticed."""
    options = FitOptions(**KINDS[kind])
    data, inputs = prepared("peg_transfer_train", options)
    model = fit_model(data, inputs, options)
    return evaluate(model, calibration_data([recording("sampled_train")], model.features)).joints


@pytest.mark.parametrize("kind", KINDS_BY_TIME[1:])
def test_dense_training_is_known_to_say_little_of_points_all_over_the_range(kind: str) -> None:
    """Of a regression each joint has its own range: where its error is expected to be the fixed offset's."""
    outside = [joint.outside_valid_range for joint in errors_on_other_motion(kind)]
    assert max(outside) > (0.5 if kind == "polynomial" else 0.2)


@pytest.mark.parametrize("kind", KINDS_BY_TIME)
def test_no_model_is_much_worse_than_the_offset_on_motion_it_was_not_made_for(kind: str) -> None:
    for joint in errors_on_other_motion(kind):
        # 1.2: rows that count as inside may still be off
        assert joint.rmse <= 1.2 * joint.offset_rmse, joint.name


@pytest.mark.parametrize("kind", KINDS_BY_TIME)
@pytest.mark.parametrize("trained", ["random_train", "sampled_train"])
def test_no_correction_of_another_motion_is_taken_for_one_that_was_never_seen(kind: str, trained: str) -> None:
    options = FitOptions(**KINDS[kind])
    data, inputs = prepared(trained, options, held_out=0.2)
    early, late = data.split_by_time(0.2)
    model = fit_model(early, inputs, options)
    others = [recording(path.stem) for path in sorted(FOLDER.glob("*.npz")) if path.stem != trained]
    for rows in (late, *(calibration_data([log], model.features) for log in others)):
        inside = model.correct(rows.X, rows.q_nominal)[1]
        assert (model.inside(rows.X) & ~inside).mean() < 1e-3, rows.sources[0].name


@pytest.mark.parametrize("held_out", [0.0, 0.2])
@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.npz")), ids=lambda path: path.stem)
def test_no_motion_of_the_arm_is_a_leap(path: Path, held_out: float) -> None:
    log = read_log(path)
    options = FitOptions()
    features = choose_inputs(Recordings.of([log]), options, held_out=held_out).features
    assert features.steps
    X, _, leaps = features.rows(log)
    assert not any(leaps.values())
    assert_array_equal(X, replace(features, steps=(), period=None).matrix(log))


def sparse_part(start: int, timed: bool) -> MotionLog:
    """A hundred random targets of another day."""
    log, rows = recording("sampled_train"), slice(start, start + 100)
    assert log.q_encoder is not None
    assert log.time is not None
    return replace(
        log, q_nominal=log.q_nominal[rows], q_encoder=log.q_encoder[rows], ok=log.ok[rows],
        time=log.time[rows] if timed else None,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("options", [FitOptions()])
def test_on_sparse_motion_no_joint_is_worse_for_its_limits_and_intervals_hold(options: FitOptions) -> None:
    model = fit_logs([recording("random_train")], options).model
    without = replace(model, features=replace(model.features, steps=(), period=None))
    for timed in (True, False):
        data = [sparse_part(start, timed) for start in range(0, 4300, 430)]
        ours, off = (
            evaluate(each, calibration_data(data, each.features, max_error=MAX_ERROR)).joints
            for each in (model, without)
        )
        assert_array_less(rmse(ours), 1.01 * rmse(off))  # the first rows of a motion are not known yet
        # the camera was registered anew between the days, which shows on J1 and J2 (README, caveat 1); targets far from
        # each other are another kind of motion than the one learnt, of which intervals hold 90 %
        assert min(joint.coverage for joint in ours[2:]) > 0.7
        assert all(a.coverage >= b.coverage for a, b in zip(ours, off, strict=True))
