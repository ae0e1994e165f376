import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_file import load_model, save_model
from catenary.cards import stored, write_with_card
from catenary.errors import FileFormatError
from catenary.files import card_path
from recordings import fitted, recording

LOG = recording(np.random.default_rng(0), rows=40)
MODEL = fitted(LOG, kind="linear", play=(0.1,))
CARD = {"robot": "räven", "rows": 40}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "arm.npz"


def altered(path: Path, change: Callable[[dict[str, np.ndarray]], Any]) -> Path:
    """A model's file with its arrays changed."""
    save_model(MODEL, CARD, path)
    with np.load(path) as content:
        arrays = dict(content)
    change(arrays)
    np.savez(path, **arrays)
    return path


def restructured(**changes: Any) -> Callable[[dict[str, np.ndarray]], Any]:
    """Change of a model's structure; None removes a part."""

    def change(arrays: dict[str, np.ndarray]) -> None:
        structure = json.loads(str(arrays["structure"]))
        for key, value in changes.items():
            part = structure["features"] if key in FEATURES else structure
            part[key] = value
            if value is None:
                del part[key]
        arrays["structure"] = np.array(json.dumps(structure))

    return change


def replaced(key: str, values: Callable[[np.ndarray], Any]) -> Callable[[dict[str, np.ndarray]], Any]:
    return lambda arrays: arrays.update({key: np.array(values(arrays[key]))})


SEALED = "damaged: its numbers are not those that its card was written for .*; `catenary fit` makes"
TEXTS = [(key, text) for key in ("structure", "card") for text in ("", "[1, 2]", "null", "{")]
GROUP = "groups.0."
RANGE = ("valid_range.lower", "valid_range.axes", "valid_range.axis_upper")
SHAPED = ("offset", *(f"{GROUP}{each}" for each in ("columns", "predictor.weights", *RANGE)))
FEATURES = ("signals", "units", "play", "steps", "period")
PARTS = ("format", "signals", "groups", "target", "features", "joint_names")


def group(**changes: Any) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    return dict(stored(MODEL.groups[0], arrays, "groups.0")) | changes


MISFITS: list[dict[str, Any]] = [
    {"target": "torque"},
    {"joint_names": ["J1", "J1", "J2"]},
    {"groups": [group(joints=[0, 1, 1])]},
    {"groups": [group(predictor={"kind": "cubic"})]},
    {"colour": "red"},
    {"signals": ["q:J1"]},
    {"play": [["q:J1", 1e999]]},
]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *[
            (restructured(**{key: None}), f"damaged: .*{key}: this key is missing|{key} None, expected")
            for key in PARTS
        ],
        *[(restructured(**misfit), "damaged: is not a calibration model") for misfit in MISFITS],
        *[(replaced(key, lambda _, t=text: t), "damaged: is not a calibration model") for key, text in TEXTS],
        *[(replaced(key, lambda values: values[:1]), "damaged: is not a calibration model") for key in SHAPED],
        (replaced("groups.0.columns", lambda columns: columns + 5), "damaged: is not a calibration model"),
        (restructured(format="catenary.calibration.9"), "'catenary.calibration.9', expected 'catenary.cal"),
    ],
)
def test_a_file_that_was_changed_is_refused(path: Path, change: Callable[..., Any], message: str) -> None:
    with pytest.raises(FileFormatError, match=f"arm.npz: .*{message}"):
        load_model(altered(path, change))


def test_a_model_is_one_file_of_plain_arrays_with_a_readable_card_beside_it(path: Path) -> None:
    save_model(fitted(LOG, kind="offset"), {}, path)  # which is replaced
    save_model(MODEL, CARD, path)
    assert sorted(p.name for p in path.parent.iterdir()) == ["arm.card.json", "arm.npz"]
    written = json.loads(card_path(path).read_text(encoding="utf-8"))
    assert written == CARD | {"arrays_sha256": written["arrays_sha256"]}
    with np.load(path, allow_pickle=False) as arrays:
        assert all(arrays[key].dtype.kind in "fiU" for key in arrays.files)
    first = path.read_bytes()
    save_model(MODEL, CARD, path)
    assert path.read_bytes() == first
    card_path(path).unlink()
    model, card = load_model(path)
    assert (model.kind, card) == ("linear", written)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.write_bytes(pickle.dumps({"structure": 1})), "damaged: cannot be read"),
        (lambda path: path.write_bytes(np.random.default_rng(1).bytes(3000)), "damaged: cannot be read"),
        (lambda path: np.savez(path, weights=np.zeros(3), bias=np.zeros(1)), r"is not a .* \(it holds weights, bias\)"),
        (np.savez, r"is not a calibration model \(it holds nothing\)"),
    ],
    ids=["missing", "pickle", "noise", "foreign", "empty"],
)
def test_what_is_no_model_is_refused(path: Path, write: Callable[[Path], Any], message: str) -> None:
    write(path)
    with pytest.raises(FileFormatError, match=rf"arm.npz: {message}"):
        load_model(path)


def test_a_file_of_another_kind_is_no_damaged_model(tmp_path: Path) -> None:
    (tmp_path / "run.parquet").write_bytes(b"PAR1 and what follows")
    with pytest.raises(FileFormatError, match=r"run.parquet: is not a calibration model; expected one \(.npz\)"):
        load_model(tmp_path / "run.parquet")


@pytest.mark.parametrize("written", [1, 2])
def test_disk_that_fills_between_model_and_card_leaves_the_old_pair(path, monkeypatch, written: int) -> None:
    save_model(fitted(LOG, kind="offset"), CARD, path)
    before, sync, calls = {p.name: p.read_bytes() for p in path.parent.iterdir()}, os.fsync, list[int]()

    def fills(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) == written:
            raise OSError(28, os.strerror(28))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", fills)
    with pytest.raises(FileFormatError, match=r"arm.npz: cannot be written: No space left on device"):
        save_model(MODEL, CARD, path)
    assert {p.name: p.read_bytes() for p in path.parent.iterdir()} == before


def test_pickled_objects_are_refused_and_not_run(path: Path, tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "sprung",))

    save_model(MODEL, CARD, path)
    np.savez(path, **(dict(np.load(path)) | {"offset": np.array([Trap()], dtype=object)}), allow_pickle=True)
    with pytest.raises(FileFormatError, match=r"arm.npz: damaged: cannot be read"):
        load_model(path)
    assert not (tmp_path / "sprung").exists()


def test_any_array_that_is_missing_changed_or_not_finite_is_noticed(path: Path) -> None:
    save_model(MODEL, CARD, path)
    for key, values in dict(np.load(path)).items():
        cases = [(lambda arrays, key=key: arrays.pop(key), "(damaged: )?is not a calibration model")]
        if values.dtype.kind == "f" and values.size:
            last, others = values.flat[-1], np.repeat(values[None], 3, axis=0)
            others[:, *(-1 for _ in values.shape)] = last + 1e-9 + 1e-9 * abs(last), np.nan, np.inf
            messages = (SEALED, f"damaged: .*{key} holds NaN or infinity", f"damaged: .*{key} holds NaN or infinity")
            cases += [
                (replaced(key, lambda _, other=other: other), m) for other, m in zip(others, messages, strict=True)
            ]
        for change, message in cases:
            with pytest.raises(FileFormatError, match=f"arm.npz: {message}"):
                load_model(altered(path, change))


@pytest.mark.parametrize("change", [restructured(period=9.0), replaced("card", lambda _: json.dumps(CARD))])
def test_a_card_of_another_model_is_noticed(path: Path, change: Callable[..., Any]) -> None:
    with pytest.raises(FileFormatError, match=f"arm.npz: {SEALED}"):
        load_model(altered(path, change))


def test_loading_a_model_for_a_loop_imports_nothing_that_fits_one() -> None:
    program = (
        "import sys, catenary.calibration.model_file, catenary.calibration.corrector; "
        "print({'sklearn', 'pyarrow', 'matplotlib'} & set(sys.modules))"
    )
    environment = {"PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    outcome = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, env=environment)
    assert outcome.stdout.strip() == b"set()"


@pytest.mark.parametrize(("kind", "preset"), [("hysteretic", None), ("auto", None), ("neural", "best")])
def test_a_file_of_a_kind_that_is_no_longer_fitted_loads_and_says_to_fit_again(
    path: Path, kind: str, preset: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    save_model(replace(MODEL, kind=kind, preset=preset), CARD, path)
    model, _ = load_model(path)
    assert "fit again" in caplog.text
    assert model.calibrate(LOG).tobytes() == MODEL.calibrate(LOG).tobytes()


def of_the_format_before(model: CalibrationModel, path: Path, **features: Any) -> Path:
    """A file as versions before wrote it: a linear function by its own name, intervals with a margin."""
    save_model(model, CARD, path)
    with np.load(path) as content:
        arrays = dict(content)
    structure = json.loads(str(arrays.pop("structure")))
    structure["format"] = "catenary.calibration.5"
    structure["features"] |= features
    for group in structure["groups"]:
        group["predictor"] = {"kind": "linear", **{key: group["predictor"][key] for key in ("weights", "bias")}}
    if structure["intervals"]:
        structure["intervals"]["margin"] = "intervals.inside"
    del arrays["card"], structure["adjustment"]
    write_with_card(path, arrays | {"structure": np.array(json.dumps(structure))}, CARD)
    return path


def test_a_file_with_midlines_is_refused_and_says_to_fit_again(path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"torque midlines.* no longer supported: fit again"):
        load_model(of_the_format_before(MODEL, path, midlines=[["tau:J1", "q:J1", 0.1, 1.0]]))


def test_a_file_of_the_format_before_loads(path: Path) -> None:
    widths = Intervals(0.9, np.full(3, 0.01), np.full(3, 0.03))
    model, _ = load_model(of_the_format_before(replace(MODEL, intervals=widths), path))
    assert model.calibrate(LOG).tobytes() == MODEL.calibrate(LOG).tobytes()
    assert model.intervals is not None
    np.testing.assert_array_equal(model.intervals.outside, widths.outside)


def test_a_learned_file_of_the_format_before_loads(path: Path) -> None:
    log = recording(np.random.default_rng(1), rows=400)
    learned = fitted(log, kind="learned")
    save_model(learned, CARD, path)
    with np.load(path) as content:
        arrays = dict(content)
    structure = json.loads(str(arrays.pop("structure")))
    structure["format"] = "catenary.calibration.5"
    for group in structure["groups"]:  # leverage stood beside the rest
        leverage = group["predictor"].pop("leverage")
        group["predictor"] |= {"sketch_bias" if key == "constants" else key: at for key, at in leverage.items()}
    del arrays["card"], structure["adjustment"]
    write_with_card(path, arrays | {"structure": np.array(json.dumps(structure))}, CARD)
    model, _ = load_model(path)
    assert model.calibrate(log).tobytes() == learned.calibrate(log).tobytes()
    assert model.half_widths(log).tobytes() == learned.half_widths(log).tobytes()
