from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model_kinds import LEARNED, MODEL_KINDS
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from recordings import data_of, fitted, recording


def bent(q: np.ndarray) -> np.ndarray:
    """Error that is neither linear nor the same for all joints."""
    return 0.01 + 0.05 * q @ np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.1], [3.0, 0.0, 1.0]]) + 0.02 * q**2


def log(seed: int = 0, rows: int = 300, **changes: Any) -> Any:
    return recording(np.random.default_rng(seed), rows=rows, error=bent, **changes)


MONOMIALS = PolynomialFeatures(2, include_bias=False)
STANDARDISED_MONOMIALS = [StandardScaler(), MONOMIALS, StandardScaler(), Ridge(alpha=10.0)]


@pytest.mark.parametrize(
    ("options", "theirs", "atol"),
    [
        ({"kind": "linear"}, [LinearRegression()], 1e-10),
        ({"kind": "linear", "play": (0.1, 0.2)}, [StandardScaler(), Ridge(alpha=10.0)], 1e-10),
        ({"kind": "polynomial"}, [PolynomialFeatures(2), LinearRegression()], 1e-10),
        ({"kind": "polynomial", "inputs": ("q:J1",)}, [PolynomialFeatures(2), LinearRegression()], 1e-10),
        ({"kind": "polynomial", "ridge": 10.0}, STANDARDISED_MONOMIALS, 1e-10),
    ],
)
def test_regressions_agree_with_scikit_learn(options: Any, theirs: list[Any], atol: float) -> None:
    model = fitted(log(), **options)
    data = calibration_data([log()], model.features)
    expected = make_pipeline(*theirs).fit(data.X, data.error).predict(data.X)
    assert_allclose(model.correction(data.X, data.q_nominal), expected, atol=atol)


def test_joint_is_fitted_to_its_own_inputs_together_with_those_of_the_same() -> None:
    run, inputs = log(), {"J1": ("q:J1",), "J2": ("q:J1",), "J3": ("q:J1", "q:J3")}
    model = fitted(run, inputs=inputs)
    assert [group.joints for group in model.groups] == [(0, 1), (2,)]
    error, calibrated = run.q_encoder - run.q_nominal, model.calibrate(run)
    for joint, columns in enumerate(([0], [0], [0, 2])):
        X = run.q_nominal[:, columns]
        expected = LinearRegression().fit(X, error[:, joint]).predict(X)
        assert_allclose(calibrated[:, joint] - run.q_nominal[:, joint], expected, atol=1e-10)


def test_the_learner_takes_play_states_of_every_joint_that_moves_and_others_when_asked() -> None:
    run, shares = log(), MODEL_KINDS[LEARNED].play_shares
    q = run.q_nominal.copy()
    q[:, 1] = 0.3
    still = Recordings.of([replace(run, q_nominal=q)])
    play = choose_inputs(still, FitOptions()).features.play
    assert [signal for signal, _ in play] == ["q:J1"] * len(shares) + ["q:J3"] * len(shares)
    assert choose_inputs(still, FitOptions("linear")).features.play == ()
    assert len(choose_inputs(still, FitOptions("linear", play=(0.1,))).features.play) == 2


def test_the_learner_takes_its_joints_own_signals_and_other_kinds_all() -> None:
    recorded = log()
    more = replace(
        recorded, signals={"q:roll": recorded.q_nominal[:, 0]}, signal_units={"q:roll": recorded.joint_units[0]}
    )
    taken = {
        kind: choose_inputs(Recordings.of([more]), FitOptions(kind)).features.signals for kind in (LEARNED, "linear")
    }
    assert "q:roll" in taken["linear"]
    assert set(taken["linear"]) - set(taken[LEARNED]) == {"q:roll"}


def test_play_half_widths_are_shares_of_the_motion_of_all_recordings() -> None:
    logs = [log(0), log(1)]
    q = np.concatenate([run.q_nominal[:, 2] for run in logs])
    play = dict(choose_inputs(Recordings.of(logs), FitOptions(inputs=("q:J3",), play=(0.1,))).features.play)
    assert play["q:J3"] == pytest.approx(0.1 * (q.max() - q.min()))


def test_play_half_widths_do_not_look_at_the_held_out_part() -> None:
    run = log()
    q = run.q_nominal.copy()
    q[240:] *= 9.0
    options = FitOptions(play=(0.1,))
    assert choose_inputs(Recordings.of([run]), options, held_out=0.2) == choose_inputs(
        Recordings.of([replace(run, q_nominal=q)]), options, held_out=0.2
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "cubic"}, 'model "cubic": expected one of offset, linear, polynomial, neural, learned'),
        ({"kind": "hysteretic"}, "expected one of offset, linear"),
        ({"kind": "linear", "preset": "best"}, 'preset "best" of model "linear": there is paper of neural alone'),
        ({"target": "torque"}, 'target "torque": expected one of error, position'),
        ({"play": (1.5,)}, "play: expected shares"),
        ({"play": (0.0,)}, "play: expected shares"),
        ({"ridge": -1.0}, "ridge: expected a number of zero or more"),
        ({"ridge": float("nan")}, "ridge: expected a number of zero or more"),
        ({"kind": "neural", "ridge": 1.0}, "only linear, polynomial take one"),
        ({"kind": "offset", "ridge": 0.0}, "only linear, polynomial take one"),
    ],
)
def test_options_that_contradict_each_other_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        FitOptions(**options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"inputs": ("current",)}, 'no input "current"'),
        ({"inputs": ()}, "expected at least one"),
        ({"inputs": {"J9": ("q",)}}, 'inputs of joint "J9": no such joint; joints: J1, J2, J3'),
        ({"inputs": {"J1": ()}}, "expected at least one"),
        ({"inputs": ("tau",), "play": (0.1,)}, "play: none of the inputs tau:J1, tau:J2, tau:J3 is the position"),
    ],
)
def test_inputs_that_cannot_be_had_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        choose_inputs(Recordings.of([log(tau=np.ones((300, 3)))]), FitOptions(**options))


def test_fit_without_rows_or_to_rows_of_other_features_is_refused() -> None:
    with pytest.raises(InputError, match="at least one recording"):
        choose_inputs(Recordings.of([]), FitOptions())
    with pytest.raises(InputError, match="data: 9 usable rows, expected at least 10"):
        fitted(log(rows=9))
    with pytest.raises(InputError, match="data: holds q:J1"):
        fit_model(
            data_of(log(), play=(0.1,)),
            choose_inputs(Recordings.of([log()]), FitOptions("linear")),
            FitOptions("linear"),
        )


def test_largest_correction_is_what_training_shows_without_failed_measurements() -> None:
    run = recording(np.random.default_rng(0), rows=1000, error=lambda q: 0.1 * q)
    failed = run.q_encoder.copy()
    failed[::200] += 5.0  # five rows of a thousand
    reach = 0.1 * np.abs(run.q_nominal).max(axis=0)
    assert_allclose(fitted(run, kind="linear").largest, reach, rtol=1e-9)
    largest = fitted(replace(run, q_encoder=failed), kind="linear").largest
    assert (largest < reach + 0.1).all()  # the fit itself follows them a little
    # errors that a model does not give are shown all the same
    coarse = fitted(run, kind="offset")
    assert_allclose(coarse.largest, 0.1 * np.quantile(np.abs(run.q_nominal), 0.99, axis=0), rtol=1e-9)


def test_model_knows_the_limits_of_a_robot_that_has_its_joints_and_of_no_other() -> None:
    raven = load_robot("raven2")
    names, units = raven.joint_names[:3], raven.joint_units[:3]
    middle = 0.5 * (raven.lower + raven.upper)[:3]
    plain = recording(np.random.default_rng(0), units=units, joint_names=names)
    q, truth = 0.1 * plain.q_nominal + middle, 0.1 * plain.q_encoder + middle
    q[7, 0] = truth[7, 0] = beyond = raven.upper[0] + 0.01
    shifted = replace(plain, q_nominal=q, q_encoder=truth)
    options, run = FitOptions(kind="linear"), FitRun(robot="raven2", folds=0, accept=("range",))
    limits = fit_logs([shifted], options, run).model.limits
    assert limits is not None
    assert_allclose(limits[0], raven.lower[:3])
    assert_allclose(limits[1], [beyond, *raven.upper[1:3]])
    other = replace(shifted, joint_names=("J1", "J2", "J3"))
    assert fit_logs([other], options, replace(run, robot=None)).model.limits is None


@pytest.mark.parametrize("kind", ["offset", "linear", "polynomial"])
def test_every_training_row_is_believed_also_where_a_joint_has_no_error_at_all(kind: str) -> None:
    for error in (lambda q: 0.0 * q, lambda q: 0.1 * q * [1.0, 0.0, 1.0]):
        run = recording(np.random.default_rng(0), error=error)
        model = fitted(run, kind=kind)
        data = calibration_data([run], model.features)
        assert model.correct(data.X, data.q_nominal)[1].all()


def on_a_base(tilt: float, seed: int, rows: int = 3000) -> MotionLog:
    """Two joints whose errors depend on what gravity asks of the first, on a base tilted by an angle [rad]."""
    rng, t = np.random.default_rng(seed), 0.05 * np.arange(rows)
    q = 0.6 * np.sin(t[:, None] * [0.31, 0.47] + rng.uniform(0.0, 6.0, 2))
    torque = np.sin(q[:, 0] + 0.5 * q[:, 1] + tilt)
    error = 0.02 * q + 0.05 * torque[:, None] * [1.0, 0.3] + 3e-4 * rng.normal(size=q.shape)
    return MotionLog(
        f"{tilt} {seed}", ("J1", "J2"), ("rad", "rad"), q, np.ones(rows, bool), q + error, t,
        signals={"gravity:J1": torque}, signal_units={"gravity:J1": "Nm"},
    )  # fmt: skip


def test_an_input_that_positions_determine_in_training_is_left_out() -> None:
    """On a base that stands, gravity is such an input; what it does on another base such recordings do not show."""
    options = FitOptions(inputs=("q:J1", "q:J2", "gravity:J1"))

    def fit(*tilts: float) -> FitResult:
        return fit_logs([on_a_base(tilt, k) for k, tilt in enumerate(tilts)], options, FitRun(folds=0))

    def errors(result: FitResult) -> np.ndarray:
        log = on_a_base(0.2, 10)
        return log.q_encoder - result.model.calibrate(log)

    level, several = fit(0.0, 0.0), fit(-0.3, 0.0, 0.3)
    assert "gravity:J1" not in level.model.features.signals
    assert any(note.startswith("gravity:J1: left out") for note in level.notes)
    assert "gravity:J1" in several.model.features.signals
    assert not any("left out" in note for note in several.notes)
    rms_of_several, rms_of_level = (np.sqrt(np.mean(errors(each) ** 2, axis=0)) for each in (several, level))
    assert (rms_of_several < 5e-4).all()
    # what the torque differs by, and no more
    assert (rms_of_level < 1.2 * 0.05 * 2.0 * np.sin(0.1) * np.array([1.0, 0.3])).all()


@pytest.mark.parametrize("rows", [12, 40, 80, 300])
def test_an_input_of_its_own_is_kept_however_few_the_rows(rows: int) -> None:
    rng = np.random.default_rng(rows)
    run = replace(on_a_base(0.0, 0, rows), signals={"gravity:J1": rng.normal(size=rows)})
    options = FitOptions(inputs=("q:J1", "q:J2", "gravity:J1")).of_kind(LEARNED, None)
    assert choose_inputs(Recordings.of([run]), options).determined == ()
