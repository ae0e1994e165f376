"""What `import catenary` offers."""

import doctest
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import catenary
from catenary.errors import CatenaryError, FileFormatError, InputError
from recordings import recording

ROOT = Path(__file__).parents[1]
RNG = np.random.default_rng(0)
LOG = recording(RNG, rows=200, error=lambda q: 0.01 + 0.02 * q)
UNITS = ["rad", "rad", "m"]


NO_EXAMPLE = {
    "CrtkClient": "needs a robot behind topics; docs/crtk.md has it",
    "load_closed_robot": "needs a file with a loop; docs/robots.md has one",
    "load_xacro": "needs the package xacro",
}


@pytest.mark.parametrize("name", sorted(set(catenary.__all__) - {"__version__"}))
def test_every_name_is_documented_and_has_an_example_that_runs(name: str) -> None:
    offered = getattr(catenary, name)
    assert offered.__name__ == name
    assert offered.__doc__
    (example,) = doctest.DocTestFinder(recurse=False).find(offered, name, globs={"catenary": catenary, "np": np})
    assert bool(example.examples) == (name not in NO_EXAMPLE)
    said: list[str] = []
    failed, _ = doctest.DocTestRunner(verbose=False).run(example, out=said.append)
    assert not failed, "".join(said)


def test_importing_the_package_imports_no_library_and_takes_no_time() -> None:
    program = (
        "import sys; before = set(sys.modules); import time; start = time.process_time(); import catenary; "
        "dir(catenary); print(time.process_time() - start, *{name.partition('.')[0] for name in set(sys.modules) - before})"
    )
    command, home = [sys.executable, "-c", program], {"PYTHONPATH": str(ROOT / "src")}
    outcome = subprocess.run(command, capture_output=True, text=True, check=True, env=home)
    seconds, *loaded = outcome.stdout.split()
    assert float(seconds) < 0.1
    assert {name for name in loaded if name not in sys.stdlib_module_names} == {"catenary"}


def test_a_misspelt_name_is_told() -> None:
    assert issubclass(catenary.CatenaryError, CatenaryError)
    with pytest.raises(AttributeError, match=r"no attribute 'gravity_torqe'; it has .*gravity_torque"):
        catenary.gravity_torqe  # noqa: B018


def test_examples_use_the_door_alone_and_pages_where_it_does() -> None:
    for path in (ROOT / "examples").glob("*.py"):
        assert not re.search(r"(from|import) catenary\.", path.read_text()), path.name
    for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        deeper = re.findall(r"^from catenary[.\w]* import (.*)$", path.read_text(), re.MULTILINE)
        assert not set(re.findall(r"\w+", " ".join(deeper))) & set(catenary.__all__), path.name


def test_a_model_is_fitted_to_arrays() -> None:
    model = catenary.fit(LOG.q_nominal[:150], LOG.q_encoder[:150], units=UNITS, model="linear")
    assert_allclose(model.predict(LOG.q_nominal[150:]), LOG.q_encoder[150:], atol=1e-12)
    errors = model.evaluate(LOG.q_nominal[150:], LOG.q_encoder[150:])
    assert [joint.n for joint in errors.joints] == [50, 50, 50]
    assert "J3" in str(errors)
    assert "mm" in str(errors)
    assert model.card["rows"] == 150


def test_rows_without_a_measurement_are_nan() -> None:
    truth = LOG.q_encoder.copy()
    truth[::2, 1] = np.nan
    model = catenary.fit(LOG.q_nominal, truth, units=UNITS, model="linear")
    assert model.card["rows"] == 100
    assert {joint.n for joint in catenary.evaluate(model, LOG.q_nominal, truth).joints} == {100}


def test_a_log_a_path_and_arrays_give_one_model(tmp_path: Path) -> None:
    path = str(tmp_path / "run.parquet")
    catenary.write_parquet(LOG, path)
    assert len(catenary.read_log(path)) == 200
    models = [
        catenary.fit(LOG, play=[0.1], model="linear"),
        catenary.fit([path], play=[0.1], model="linear"),
        catenary.fit(LOG.q_nominal, LOG.q_encoder, units=UNITS, time=LOG.time, play=[0.1], model="linear"),
    ]
    expected = models[0].predict(LOG)
    for model in models:
        assert_array_equal(model.predict(path), expected)
        assert model.features.period == pytest.approx(0.1)


def test_a_saved_model_is_loaded_by_a_string(tmp_path: Path) -> None:
    path = str(tmp_path / "arm.npz")
    model = catenary.fit(LOG, model="polynomial", held_out=0.2, inputs={"J1": ["q:J1"]})
    model.save(path)
    again = catenary.load_model(path)
    assert again.card.pop("arrays_sha256")
    assert again.card == json.loads(json.dumps(model.card))
    assert len(again.card["errors"]["held_out"]) == 3
    assert_array_equal(again.predict(LOG), model.predict(LOG))
    assert catenary.evaluate(path, LOG).joints == model.evaluate(LOG).joints


def test_torques_are_inputs_where_they_are_given() -> None:
    tau = RNG.normal(size=LOG.q_nominal.shape)
    true = LOG.q_nominal + 0.01 * tau
    model = catenary.fit(LOG.q_nominal, true, units=UNITS, tau=tau, joint_names=["a", "b", "c"], model="linear")
    assert model.features.signals[-1] == "tau:c"
    assert_allclose(model.predict(LOG.q_nominal, tau=tau), true, atol=1e-12)
    with pytest.raises(InputError, match='has no input "tau:a"'):
        model.predict(LOG.q_nominal)


@pytest.mark.parametrize(
    ("data", "options", "words"),
    [
        ((LOG.q_nominal, LOG.q_encoder), {}, 'units: expected "rad" or "m" for each of the 3 joints'),
        ((LOG, LOG.q_encoder), {}, "q_encoder: recordings have their own"),
        ((LOG.q_nominal, LOG.q_encoder[1:]), {"units": UNITS}, r"q_encoder: expected shape \(200, 3\), got \(199, 3\)"),
        ((LOG.q_nominal,), {"units": UNITS}, "has no q_encoder"),
        ((LOG,), {"model": "cubic"}, 'model "cubic"'),
        (("none.parquet",), {}, "no such file"),
    ],
)  # fmt: skip
def test_what_is_no_calibration_is_refused(data: tuple, options: dict, words: str) -> None:
    with pytest.raises((InputError, FileFormatError), match=words):
        catenary.fit(*data, **options)


def test_data_in_other_units_are_refused_before_they_are_called_errors_of_the_model() -> None:
    log = recording(RNG, rows=400, error=lambda q: 0.01 + 0.02 * q)
    assert log.q_encoder is not None
    model = catenary.fit(log, model="linear", folds=0)
    factor = np.where(np.array(log.joint_units) == "rad", np.rad2deg(1.0), 1e3)
    wrong = replace(log, q_nominal=factor * log.q_nominal, q_encoder=factor * log.q_encoder)
    for ask in (model.evaluate, model.refresh):
        with pytest.raises(catenary.DataError, match="fix: --units deg,deg,mm") as refused:
            ask(wrong)
        assert refused.value.names == ("units",)
    assert catenary.evaluate(model, wrong, accept=["units"]).joints
