"""What every kind of calibration model must do, whatever it was fitted to."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge

from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_file import load_model, save_model
from catenary.calibration.model_kinds import MODEL_KINDS
from catenary.errors import InputError
from catenary.workflows.c_header import c_header
from oracles.calibration_models import ticked
from recordings import fitted, recording, short_training


def truth(q: np.ndarray) -> np.ndarray:
    return 0.01 * (1.0 + q) + 0.02 * q**2


BOOSTING = HistGradientBoostingRegressor(max_iter=20, min_samples_leaf=5)
KINDS: dict[str, dict[str, Any]] = {
    **{name: {"kind": name} for name in MODEL_KINDS},
    "own": {"kind": "own", "estimator": Ridge(0.1)},
    "own of single outputs": {"kind": "own", "estimator": BOOSTING},
    "own of raw inputs per joint": {"kind": "own", "estimator": BOOSTING, "play": (), "inputs": {"J1": ("q:J1",)}},
    "own function": {"kind": "own", "estimator": truth, "inputs": ("q",)},
    "linear with play": {"kind": "linear", "play": (0.1, 0.3)},
    "learned per joint": {"kind": "learned", "inputs": {"J1": ("q:J1",), "J2": ("q:J2",), "J3": ("q",)}},
    "linear per joint": {"kind": "linear", "inputs": {"J1": ("q:J1",), "J2": ("q:J1", "q:J2")}, "play": (0.2,)},
    "polynomial with play": {"kind": "polynomial", "play": (0.1,)},
    "neural per joint": {"kind": "neural", "inputs": {"J1": ("q:J1",), "J2": ("q:J2",), "J3": ("q:J3",)}},
}
PAGE = Path(__file__).parents[2] / "docs" / "calibration.md"
CASES = [(kind, "error") for kind in KINDS]
CASES += [(kind, "position") for kind in ("linear with play", "polynomial", "neural", "neural per joint", "learned")]
CASES += [("own of single outputs", "position")]
LOG = recording(np.random.default_rng(0), error=truth)
NEW = recording(np.random.default_rng(0), rows=60, error=truth)  # the first fifth of the same motion


def owner(kind: str) -> Any:
    """The class or function of a model of one's own."""
    estimator = KINDS[kind].get("estimator")
    return type(estimator) if hasattr(estimator, "fit") else estimator


class Case:
    """A model of some kind, fitted once, and rows of its features."""

    def __init__(self, kind: str, target: str) -> None:
        self.kind = kind
        # other libraries promise no bits, of a row alone and among others
        self.rounding = 1e-12 if KINDS[kind]["kind"] == "own" else 0.0
        self.fit = lambda: fitted(LOG, **KINDS[kind], target=target)
        self.model: CalibrationModel = self.fit()
        self.data: CalibrationData = calibration_data([NEW], self.model.features)

    def correct(self, X: np.ndarray, q: np.ndarray | None = None) -> np.ndarray:
        return self.model.correction(X, self.data.q_nominal[: len(X)] if q is None else q)


quick = pytest.fixture(scope="module", autouse=True)(short_training)


@pytest.fixture(scope="module", params=CASES, ids=lambda case: ", ".join(case))
def case(request: pytest.FixtureRequest) -> Case:
    return Case(*request.param)


def test_correction_has_a_row_per_row_and_a_column_per_joint(case: Case) -> None:
    correction = case.correct(case.data.X)
    assert correction.shape == (len(case.data), 3)
    assert correction.dtype == np.float64
    assert np.isfinite(correction).all()
    assert case.correct(case.data.X[:0], np.zeros((0, 3))).shape == (0, 3)


def test_correction_of_a_single_row_is_that_of_the_row_in_a_batch(case: Case) -> None:
    batch = case.correct(case.data.X)
    for i in (0, 17, len(case.data) - 1):
        single = case.correct(case.data.X[i : i + 1], case.data.q_nominal[i : i + 1])
        assert_allclose(single[0], batch[i], rtol=0.0, atol=case.rounding)


def test_correction_leaves_its_arguments_alone(case: Case) -> None:
    X, q = case.data.X.copy(), case.data.q_nominal.copy()
    case.correct(X, q)
    assert_array_equal(X, case.data.X)
    assert_array_equal(q, case.data.q_nominal)


def test_same_seed_gives_the_same_bits(case: Case) -> None:
    again = case.fit().correction(case.data.X, case.data.q_nominal)
    assert again.tobytes() == case.correct(case.data.X).tobytes()


def test_correction_outside_the_valid_range_is_exactly_the_fixed_offset(case: Case) -> None:
    far = case.data.X + 9.0
    assert not case.model.inside(far).any()
    assert_array_equal(case.correct(far), np.tile(case.model.offset, (len(far), 1)))


def test_fixed_offset_is_the_mean_error_of_the_training_rows_which_lie_in_the_valid_range(case: Case) -> None:
    trained = calibration_data([LOG], case.model.features)
    assert case.model.inside(trained.X).all()
    assert_allclose(case.model.offset, trained.error.mean(axis=0), rtol=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_one_feature_that_is_not_finite_takes_the_offset_to_the_joints_that_use_it(case: Case, value: float) -> None:
    for column in range(case.data.X.shape[1]):
        X = case.data.X[20:21].copy()
        X[0, column] = value
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            correction = case.correct(X)[0]
        for group in case.model.groups:
            if column in group.columns:
                assert_array_equal(correction[list(group.joints)], case.model.offset[list(group.joints)])


def test_saved_and_loaded_model_gives_the_same_bits_and_says_the_same_of_itself(case: Case, tmp_path: Path) -> None:
    save_model(case.model, {"robot": None}, tmp_path / "model.npz")
    back, _ = load_model(tmp_path / "model.npz", owner(case.kind))
    assert back.calibrate(NEW).tobytes() == case.model.calibrate(NEW).tobytes()
    assert back.inside(case.data.X + 0.3).tobytes() == case.model.inside(case.data.X + 0.3).tobytes()
    for key in ("kind", "preset", "joint_names", "joint_units", "features", "target"):
        assert getattr(back, key) == getattr(case.model, key)
    assert [group.joints for group in back.groups] == [group.joints for group in case.model.groups]


@pytest.mark.parametrize("kind", KINDS)
def test_model_of_the_error_is_no_worse_than_the_offset_on_its_training_rows(kind: str) -> None:
    model = fitted(LOG, **KINDS[kind])
    data = calibration_data([LOG], model.features)
    left = data.error - model.correction(data.X, data.q_nominal)
    # training brings a sum of squares down from that of the mean; 1e-9 for rounding
    assert np.all((left**2).mean(axis=0) <= data.error.var(axis=0) * (1.0 + 1e-9))


@pytest.mark.parametrize("kind", KINDS)
def test_joint_that_never_moved_breaks_no_model_and_is_watched(kind: str) -> None:
    q = LOG.q_nominal.copy()
    q[:, 1] = 0.1
    still = replace(LOG, q_nominal=q, q_encoder=q + truth(q))
    model = fitted(still, **KINDS[kind])
    assert_allclose(model.calibrate(still)[:, 1], 0.1 + truth(np.array(0.1)), atol=1e-9)  # a constant error
    q = q.copy()
    q[:, 1] = 0.2
    takes_it = [j for g in model.groups if "q:J2" in [model.features.names[c] for c in g.watched] for j in g.joints]
    X = model.features.matrix(replace(still, q_nominal=q))
    assert not model.inside(X)[:, takes_it].any()


@pytest.mark.parametrize("kind", KINDS)
def test_single_joint_is_calibrated_without_a_warning(kind: str) -> None:
    options = {key: value for key, value in KINDS[kind].items() if key != "inputs"}
    log = recording(np.random.default_rng(3), rows=100, units=("m",), error=truth)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = fitted(log, **options)
    assert np.isfinite(model.calibrate(log)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_ten_rows_are_enough_for_any_kind(kind: str) -> None:
    log = recording(np.random.default_rng(4), rows=10, error=truth)
    assert np.isfinite(fitted(log, **KINDS[kind]).calibrate(log)).all()


def test_a_loop_gives_what_the_model_gives_which_so_looks_at_no_later_row_and_no_measurement(case: Case) -> None:
    out, inside = ticked(Corrector(case.model), NEW.q_nominal, case.model.features.signal_rows(NEW))
    assert np.isfinite(out).all()
    assert_allclose(out, case.model.calibrate(NEW), rtol=0.0, atol=case.rounding)
    assert_array_equal(inside, case.model.inside(case.model.features.matrix(NEW)))


def test_c_is_written_of_kinds_that_say_so_and_refused_of_others(case: Case) -> None:
    if MODEL_KINDS[case.model.kind].in_c:
        assert "model_correct" in c_header(None, case.model).text
    else:
        with pytest.raises(InputError, match="Python only"):
            c_header(None, case.model)


@pytest.mark.parametrize("name", MODEL_KINDS)
def test_a_kind_has_a_row_in_the_page(name: str) -> None:
    assert f"\n| `{name}" in PAGE.read_text()
