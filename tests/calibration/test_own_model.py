import json
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import catenary
from catenary.calibration.own_model import fit_own, name_of
from catenary.errors import DataError, FileFormatError, InputError, MissingPackageError
from command_line import catenary as run
from recordings import recording

RNG = np.random.default_rng(0)


def bend(q: np.ndarray) -> np.ndarray:
    return 0.01 * np.tanh(5.0 * q) + 0.003 * RNG.normal(size=q.shape)


def tanh_of(X: np.ndarray) -> np.ndarray:
    return 0.01 * np.tanh(5.0 * X)


class Mean:
    """An estimator with its own file."""

    def fit(self, X, y):
        self.mean = float(np.mean(y))

    def predict(self, X):
        return np.full(len(X), self.mean)

    def get_params(self, deep=True):
        return {}

    def save(self, path):
        Path(path).write_text(json.dumps(self.mean))

    @classmethod
    def load(cls, path):
        made = cls()
        made.mean = json.loads(Path(path).read_text())
        return made


LOG = recording(RNG, rows=1200, error=bend)
DAY = recording(np.random.default_rng(1), rows=800, error=lambda q: bend(q) + 0.02, name="tuesday")
BOOSTING = HistGradientBoostingRegressor(max_iter=30)


@pytest.fixture(scope="module")
def boosted() -> catenary.Calibration:
    return catenary.fit(LOG, model=BOOSTING)


def test_an_estimator_gets_what_a_kind_gets_and_stays_unfitted(boosted):
    assert not hasattr(BOOSTING, "n_iter_")
    assert boosted.intervals is not None
    assert any(name.startswith("play(") for name in boosted.features.names)
    spread, own = boosted.card["errors"]["cross_validation"]["joints"], boosted.card["settings"]["estimator"]
    assert all(joint["rmse_mean"] < joint["offset_rmse_mean"] for joint in spread)
    assert own == "HistGradientBoostingRegressor(max_iter=30)"
    assert 0.0 < boosted.card["tick_seconds"] < 1.0
    assert any("a tick of a loop takes" in note for note in boosted.card["notes"])


def test_intervals_hold_on_other_motion(boosted):
    again = recording(np.random.default_rng(7), rows=1200, error=bend, name="again")
    assert all(0.8 <= joint.coverage <= 0.99 for joint in boosted.evaluate(again).joints)


def test_a_refresh_finds_the_zero_of_another_day(boosted):
    refreshed = boosted.refresh(DAY)
    assert_allclose(refreshed.offset - boosted.offset, 0.02, atol=0.002)
    assert "since" in refreshed.card["refreshed"][0]["moved"]


def test_play_of_nothing_gives_the_estimator_what_is_recorded_alone():
    model = catenary.fit(LOG, model=Ridge(), play=(), folds=0)
    assert model.features.names == ("q:J1", "q:J2", "q:J3")


def test_a_function_is_fitted_to_nothing_and_its_card_says_so():
    model = catenary.fit(LOG, model=tanh_of)
    assert_allclose(model.predict(LOG), LOG.q_nominal + tanh_of(LOG.q_nominal), atol=1e-15)
    assert any("no block was left out of the function" in note for note in model.card["notes"])


def test_evaluate_takes_a_function_and_no_estimator():
    found = catenary.evaluate(tanh_of, LOG)
    left = LOG.q_encoder - LOG.q_nominal - tanh_of(LOG.q_nominal)
    assert_allclose(found.after_model, left, atol=1e-15)
    with pytest.raises(InputError, match="fitted first"):
        catenary.evaluate(Ridge(), LOG)


def test_a_function_is_evaluated_on_what_would_be_too_short_to_learn_from():
    assert len(catenary.evaluate(tanh_of, LOG.part(0, 40)).after_model) == 40
    with pytest.raises(DataError):
        catenary.fit(LOG.part(0, 40), model=Ridge())


def test_random_states_that_are_unset_become_the_seed():
    forest = make_pipeline(StandardScaler(), RandomForestRegressor(5))
    X, Y = RNG.normal(size=(50, 3)), RNG.normal(size=(50, 2))
    a, b, c = (fit_own(X, Y, estimator=forest, seed=seed).predict(X) for seed in (1, 1, 2))
    assert_array_equal(a, b)
    assert (a != c).any()


def test_an_estimator_of_several_outputs_is_one_and_others_one_for_each_joint():
    X, Y = RNG.normal(size=(50, 3)), RNG.normal(size=(50, 2))
    assert len(fit_own(X, Y, estimator=Ridge(), seed=0).fitted) == 1
    assert len(fit_own(X, Y, estimator=BOOSTING, seed=0).fitted) == 2


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (lambda X: X[:, :2], "expected 3 outputs"),
        (type("NoClone", (), {"fit": None, "predict": None})(), "clone"),
        (3, "clone"),
        ([], "clone"),
        ("no_such_module:Thing", "PYTHONPATH"),
        ("sklearn.linear_model:NoSuchRidge", "PYTHONPATH"),
    ],
)
def test_what_is_no_model_is_refused_in_words(model, said):
    with pytest.raises(InputError, match=said):
        catenary.fit(LOG, model=model)


@pytest.mark.parametrize(
    ("model", "owner"),
    [
        (BOOSTING, HistGradientBoostingRegressor),
        (Mean(), Mean),
        (tanh_of, tanh_of),
        (make_pipeline(StandardScaler(), Ridge()), "sklearn.pipeline:Pipeline"),
    ],
    ids=["by skops", "by its own file", "by its name", "a pipeline"],
)
def test_a_file_runs_where_its_class_is_named_alone(tmp_path, model, owner):
    made = catenary.fit(LOG, model=model, folds=0)
    made.save(tmp_path / "own.npz")
    assert b"pickle" not in (tmp_path / "own.npz").read_bytes()
    bare = catenary.load_model(tmp_path / "own.npz")
    assert bare.card["kind"] == "own"
    with pytest.raises(InputError, match="only where its class is named"):
        bare.predict(LOG)
    with pytest.raises(InputError, match="is not loaded as"):
        catenary.load_model(tmp_path / "own.npz", own=RandomForestRegressor)
    loaded = catenary.load_model(tmp_path / "own.npz", own=owner)
    assert_array_equal(loaded.predict(LOG), made.predict(LOG))
    bare.save(tmp_path / "again.npz")  # without its class, as a refresh of its card would
    assert_array_equal(catenary.load_model(tmp_path / "again.npz", own=owner).predict(LOG), made.predict(LOG))


def test_reading_a_file_imports_nothing_that_it_names(tmp_path, monkeypatch):
    module = ModuleType("of_a_stranger")
    module.Ridge = type("Ridge", (Ridge,), {"__module__": "of_a_stranger"})
    monkeypatch.setitem(sys.modules, "of_a_stranger", module)
    catenary.fit(LOG, model=module.Ridge(), folds=0).save(tmp_path / "own.npz")
    monkeypatch.delitem(sys.modules, "of_a_stranger")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        catenary.load_model(tmp_path / "own.npz")
        with pytest.raises(InputError, match="is not loaded as"):
            catenary.load_model(tmp_path / "own.npz", own=Ridge)
    assert "of_a_stranger" not in sys.modules


def test_types_of_packages_that_are_not_named_are_refused(tmp_path, monkeypatch):
    module = ModuleType("of_a_stranger")
    module.Scaler = type("Scaler", (StandardScaler,), {"__module__": "of_a_stranger"})
    monkeypatch.setitem(sys.modules, "of_a_stranger", module)
    made = catenary.fit(LOG, model=make_pipeline(module.Scaler(), Ridge()), folds=0)
    made.save(tmp_path / "own.npz")
    with pytest.raises(InputError, match=r"of_a_stranger\.Scaler"):
        catenary.load_model(tmp_path / "own.npz", own="sklearn.pipeline:Pipeline")
    both = ["sklearn.pipeline:Pipeline", module.Scaler]
    assert_array_equal(catenary.load_model(tmp_path / "own.npz", own=both).predict(LOG), made.predict(LOG))


def test_a_function_without_a_name_has_no_file(tmp_path):
    made = catenary.fit(LOG, model=lambda X: 0.0 * X, folds=0)
    with pytest.raises(InputError, match="function that its module names"):
        made.save(tmp_path / "own.npz")


def test_without_skops_an_estimator_has_no_file_and_the_message_says_what_to_install(tmp_path, monkeypatch):
    made = catenary.fit(LOG, model=Ridge(), folds=0)
    monkeypatch.setitem(sys.modules, "skops.io", None)
    with pytest.raises(MissingPackageError, match="need skops: pip install"):
        made.save(tmp_path / "own.npz")


def test_an_estimator_of_another_class_than_the_file_says_is_refused(tmp_path):
    made = catenary.fit(LOG, model=Ridge(), folds=0)
    groups = (
        replace(made.groups[0], predictor=replace(made.groups[0].predictor, name=name_of(RandomForestRegressor))),
    )
    replace(made, groups=groups).save(tmp_path / "own.npz")
    with pytest.raises(FileFormatError, match=r"expected sklearn\.ensemble"):
        catenary.load_model(tmp_path / "own.npz", own=RandomForestRegressor)


def test_the_command_line_takes_module_and_name(tmp_path):
    catenary.write_parquet(LOG, tmp_path / "log.parquet")
    catenary.write_parquet(DAY, tmp_path / "day.parquet")
    model, ridge = tmp_path / "own.npz", "sklearn.linear_model:Ridge"
    assert run("fit", tmp_path / "log.parquet", "--model", ridge, "--out", model).code == 0
    assert "only where its class is named" in run("evaluate", model, tmp_path / "day.parquet").err
    assert run("evaluate", model, tmp_path / "day.parquet", "--own", ridge).code == 0
    new = tmp_path / "new.npz"
    assert run("refresh", model, tmp_path / "day.parquet", "--own", ridge, "--out", new).code == 0
    assert "PYTHONPATH" in run("fit", tmp_path / "log.parquet", "--model", "no_such:Thing", "--out", new).err
    assert "needs one" in run("fit", tmp_path / "log.parquet", "--model", "own", "--out", new).err
    assert run("check", model).code == 0
    assert "no C of it" in run("export", "--model", model, "--c", tmp_path / "arm.h").err
    refused = run(
        "calibrate",
        tmp_path / "project",
        tmp_path / "log.parquet",
        "--test",
        tmp_path / "day.parquet",
        "--model",
        ridge,
    )
    assert "catenary fit --model" in refused.err


def test_a_file_with_other_bytes_than_an_estimators_is_refused(tmp_path):
    made = catenary.fit(LOG, model=Ridge(), folds=0)
    for content in (b"skops:PK no archive", b"skops:", b"junk"):
        bytes_of = np.frombuffer(content, dtype=np.uint8)
        groups = (replace(made.groups[0], predictor=replace(made.groups[0].predictor, fitted=(bytes_of,))),)
        replace(made, groups=groups).save(tmp_path / "own.npz")
        with pytest.raises(FileFormatError, match="cannot be read"):
            catenary.load_model(tmp_path / "own.npz", own=Ridge)


def test_a_loop_takes_an_estimator_of_which_a_reading_is_nan(boosted):
    corrector, out, inside = boosted.corrector(), np.empty(3), np.empty(3, dtype=bool)
    corrector.correct(LOG.q_nominal[0], [np.nan, *LOG.q_nominal[0, 1:]], out, inside)
    assert not inside.any()
    assert_allclose(out, LOG.q_nominal[0] + boosted.offset)
