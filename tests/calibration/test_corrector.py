import pickle
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.plant import JointState, MotionLog
from oracles.calibration_models import random_model, ticked
from recordings import fitted

RNG = np.random.default_rng(0)
SIGNALS = np.cumsum(0.2 * RNG.normal(size=(200, 5)), axis=0)  # three positions, two torques
NAMES, UNITS = ("j0", "j1", "j2"), ("rad", "rad", "m")


def model(**options: object) -> CalibrationModel:
    return random_model("linear", SIGNALS, np.random.default_rng(1), joints=3, torques=2, **options)  # type: ignore[arg-type]


def state(q: Floats, tau: Floats) -> JointState:
    return JointState(0.0, q, np.zeros_like(q), tau, np.zeros(0), np.zeros(3), 0.0)


@pytest.mark.parametrize(
    "options", [{"plays": 2}, {"coupled": 2}], ids=["play states need no rate", "friction states need none"]
)
def test_motion_held_for_some_ticks_is_calibrated_as_that_of_the_training(options) -> None:
    calibrated, flags = ticked(Corrector(model(**options), rate_hz=1000.0), SIGNALS[:, :3], SIGNALS)
    held = np.repeat(SIGNALS, 7, axis=0)
    out, inside = ticked(Corrector(model(**options), rate_hz=7000.0), held[:, :3], held)
    assert_array_equal(out[::7], calibrated)
    assert_array_equal(inside[::7], flags)


def test_nan_before_the_first_number_does_not_stick_in_the_play_states() -> None:
    corrector = Corrector(model(plays=2))
    late = SIGNALS.copy()
    late[:5] = np.nan
    out, _ = ticked(corrector, late[:, :3], late)
    expected, _ = ticked(corrector, SIGNALS[5:, :3], SIGNALS[5:])
    assert np.isnan(out[:5]).all()
    assert_array_equal(out[5:], expected)


def test_joint_state_of_a_robot_with_more_joints_in_another_order() -> None:
    corrector = Corrector(replace(model(plays=1), intervals=Intervals(0.9, *np.outer([1, 1], [0.1, 0.2, 0.3]))))
    corrector.prepare(["wrist", "j2", "j0", "j1"], ["rad", "m", "rad", "rad"], 1000.0)
    expected, flags = ticked(corrector, SIGNALS[:, :3], SIGNALS)
    corrector.reset()
    out, inside, width = np.empty(4), np.empty(4, dtype=bool), np.empty(4)
    for k, row in enumerate(SIGNALS):
        q = np.array([7.0, row[2], row[0], row[1]])
        tau = np.array([9.0, 0.0, row[3], row[4]])
        corrector.correct_state(state(q, tau), out, inside, width)
        assert_array_equal(out, [7.0, expected[k, 2], expected[k, 0], expected[k, 1]])
        assert_array_equal(inside, [True, flags[k, 2], flags[k, 0], flags[k, 1]])
        assert_array_equal(width, [np.nan, 0.3, 0.1, 0.2])
    with pytest.raises(InputError, match="inside and interval are not of the robot"):
        corrector.correct_state(state(q, tau), out, inside, np.empty(3))


def test_the_unused_channel_of_an_arm_reads_what_it_read_in_training() -> None:
    rng = np.random.default_rng(5)
    q, error = rng.normal(size=(200, 1)), rng.normal(size=(200, 1))
    log = MotionLog(
        "run", ("j0",), ("rad",), q, np.ones(200, dtype=bool), q + error, tau=rng.normal(size=(200, 1)),
        signals={"q:unused": np.full(200, 3.5), "tau:unused": np.zeros(200)},
    )  # fmt: skip
    made = fitted(log, inputs=("q", "tau"))
    assert made.features.signals == ("q:j0", "q:unused", "tau:j0", "tau:unused")
    expected, flags = made.calibrate(log), made.inside(made.features.matrix(log))
    corrector, out, inside = Corrector(made), np.empty(1), np.empty(1, dtype=bool)
    corrector.prepare(["j0"], ["rad"], 1000.0)
    for k in range(20):
        corrector.correct_state(state(q[k], log.tau[k]), out, inside)
        assert_array_equal(out, expected[k])
        assert_array_equal(inside, flags[k])
        assert inside.all()


FEATURES = model().features
HOT = replace(FEATURES, signals=(*FEATURES.signals[:4], "motor_temperature"))


@pytest.mark.parametrize(
    ("made", "robot", "message"),
    [
        (model(), (NAMES[:2], UNITS[:2], 1000.0), r'the robot has no joint "j2"; it has j0 \[rad\], j1'),
        (model(), (NAMES, ("rad",) * 3, 1000.0), 'the robot has joint "j2" in rad, not m'),
        (replace(model(), features=HOT), (NAMES, UNITS, 1e3), '"motor_temperature" is in no joint state'),
    ],
)
def test_robots_that_a_model_is_not_of_are_refused(made: CalibrationModel, robot: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Corrector(made).prepare(*robot)


Q, VALUES, OUT, INSIDE = np.zeros(3), np.zeros(5), np.zeros(3), np.zeros(3, dtype=bool)
FIXED = np.zeros(3)
FIXED.setflags(write=False)


@pytest.mark.parametrize(
    ("method", "arrays", "message"),
    [
        ("correct", (Q, VALUES, FIXED, INSIDE), "read-only"),
        ("correct", (Q[:2], VALUES, OUT, INSIDE), r"expected q_nominal \(3,\), signals \(5,\)"),
        ("correct", (Q, VALUES[:4], OUT, INSIDE), r"got \(3,\), \(4,\)"),
        ("correct", (Q, VALUES, np.zeros(4), INSIDE), r"got \(3,\), \(5,\), \(4,\)"),
        ("correct", (Q, VALUES, OUT, INSIDE[:2]), r"got .*, \(2,\)"),
        ("correct_state", (state(Q, Q), OUT, INSIDE), "not of the robot that it was prepared for"),
        ("bind", (Q, VALUES[:4], OUT, INSIDE), r"expected q_nominal \(3,\), .* got \(3,\), \(4,\)"),
        ("bind", (Q, VALUES, Q, INSIDE), "overlaps"),
        ("bind", (Q, VALUES, OUT.astype(np.float32), INSIDE), "float32"),
    ],
)
def test_arrays_that_cannot_be_taken_are_refused(method: str, arrays: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        getattr(Corrector(model()), method)(*arrays)


@pytest.mark.parametrize("copied", [deepcopy, lambda corrector: pickle.loads(pickle.dumps(corrector))])
def test_a_copy_goes_on_from_the_same_memory_and_then_has_its_own(copied) -> None:
    first = Corrector(model(plays=1))
    expected, _ = ticked(first, SIGNALS[:, :3], SIGNALS)
    ticked(first, SIGNALS[:50, :3], SIGNALS[:50])
    second, out, inside = copied(first), np.empty(3), np.empty(3, dtype=bool)
    for k in range(50, 70):
        for corrector in (first, second):
            corrector.correct(SIGNALS[k, :3], SIGNALS[k], out, inside)
            assert_array_equal(out, expected[k])
    second.correct(Q, VALUES, out, inside)
    first.correct(SIGNALS[70, :3], SIGNALS[70], out, inside)
    assert_array_equal(out, expected[70])
