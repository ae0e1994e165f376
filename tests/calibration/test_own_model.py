import json
import sys
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


def test_a_function_is_fitted_to_nothing_and_its_card_says_so():
    model = catenary.fit(LOG, model=tanh_of)
    assert_allclose(model.predict(LOG), LOG.q_nominal + tanh_of(LOG.q_nominal), atol=1e-15)
    assert any("no block was left out of the function" in note for note in model.card["notes"])
    short = LOG.part(0, 40)  # too short to learn from
    left = short.q_encoder - short.q_nominal - tanh_of(short.q_nominal)
    assert_allclose(catenary.evaluate(tanh_of, short).after_model, left, atol=1e-15)
    with pytest.raises(InputError, match="fitted first"):
        catenary.evaluate(Ridge(), LOG)
    with pytest.raises(DataError):
        catenary.fit(short, model=Ridge())


def test_random_states_that_are_unset_become_the_seed():
    forest = make_pipeline(StandardScaler(), RandomForestRegressor(5))
    X, Y = RNG.normal(size=(50, 3)), RNG.normal(size=(50, 2))
    a, b, c = (fit_own(X, Y, estimator=forest, seed=seed).predict(X) for seed in (1, 1, 2))
    assert_array_equal(a, b)
    assert (a != c).any()


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (lambda X: X[:, :2], "expected 3 outputs"),
        (type("NoClone", (), {"fit": None, "predict": None})(), "clone"),
        ([], "clone"),
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


@pytest.fixture
def stranger(monkeypatch):
    """A module that is installed until its model was stored."""
    module = ModuleType("of_a_stranger")
    module.Ridge = type("Ridge", (Ridge,), {"__module__": "of_a_stranger"})
    monkeypatch.setitem(sys.modules, "of_a_stranger", module)
    return module


def test_reading_a_file_imports_nothing_that_it_names(stranger, tmp_path, monkeypatch):
    catenary.fit(LOG, model=stranger.Ridge(), folds=0).save(tmp_path / "own.npz")
    monkeypatch.delitem(sys.modules, "of_a_stranger")
    catenary.load_model(tmp_path / "own.npz")
    with pytest.raises(InputError, match="is not loaded as"):
        catenary.load_model(tmp_path / "own.npz", own=Ridge)
    assert "of_a_stranger" not in sys.modules


def test_types_of_packages_that_are_not_named_are_refused(stranger, tmp_path):
    made = catenary.fit(LOG, model=make_pipeline(StandardScaler(), stranger.Ridge()), folds=0)
    made.save(tmp_path / "own.npz")
    with pytest.raises(InputError, match=r"of_a_stranger\.Ridge"):
        catenary.load_model(tmp_path / "own.npz", own="sklearn.pipeline:Pipeline")
    both = ["sklearn.pipeline:Pipeline", stranger.Ridge]
    assert_array_equal(catenary.load_model(tmp_path / "own.npz", own=both).predict(LOG), made.predict(LOG))


@pytest.mark.parametrize(
    ("model", "error", "said"),
    [
        (lambda X: 0.0 * X, InputError, "function that its module names"),
        (Ridge(), MissingPackageError, "need skops: pip install"),
    ],
)
def test_what_cannot_be_stored_is_refused_with_the_way_out(model, error, said, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "skops.io", None)
    with pytest.raises(error, match=said):
        catenary.fit(LOG, model=model, folds=0).save(tmp_path / "own.npz")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": name_of(RandomForestRegressor)}, r"expected sklearn\.ensemble"),
        *(({"fitted": (np.frombuffer(b, np.uint8),)}, "cannot be read") for b in (b"skops:PK no", b"skops:", b"junk")),
    ],
)
def test_a_file_that_holds_another_estimator_or_none_is_refused(change, said, tmp_path):
    made = catenary.fit(LOG, model=Ridge(), folds=0)
    group = replace(made.groups[0], predictor=replace(made.groups[0].predictor, **change))
    replace(made, groups=(group,)).save(tmp_path / "own.npz")
    with pytest.raises(FileFormatError, match=said):
        catenary.load_model(tmp_path / "own.npz", own=RandomForestRegressor if "name" in change else Ridge)


def test_the_command_line_takes_module_and_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, log in (("log", LOG), ("day", DAY)):
        catenary.write_parquet(log, f"{name}.parquet")
    own = ("--own", "sklearn.linear_model:Ridge")
    for code, said, line in [
        (0, "", f"fit log.parquet --model {own[1]} --out own.npz"),
        (2, "only where its class is named", "evaluate own.npz day.parquet"),
        (0, "", f"evaluate own.npz day.parquet {' '.join(own)}"),
        (0, "", f"refresh own.npz day.parquet {' '.join(own)} --out new.npz"),
        (2, "only where its class is named", "plot own.npz day.parquet --out own.pdf"),
        (0, "", f"plot own.npz day.parquet --out own.pdf {' '.join(own)}"),
        (0, "", "check own.npz"),
        (2, "PYTHONPATH", "fit log.parquet --model no_such:Thing --out new.npz"),
        (2, "needs one", "fit log.parquet --model own --out new.npz"),
        (2, "no C export", "export --model own.npz --c arm.h"),
        (2, "catenary fit --model", f"calibrate project log.parquet --test day.parquet --model {own[1]}"),
    ]:
        ended = run(*line.split())
        assert (ended.code, said in ended.err) == (code, True), (line, ended.err)
