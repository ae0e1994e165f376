"""What bounds a correction, in all three forms of a model: rows, ticks and C, whatever one of its numbers is."""

from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import MAX_CORRECTION_RATIO, CalibrationModel
from catenary.errors import InputError
from catenary.workflows.c_header import c_header
from compiled_c import output_of, puts
from oracles.calibration_models import MIXED, PREDICTORS, log_of, random_model, ticked

Given = tuple[Floats, NDArray[np.bool_]]  # corrections, and which of them are predictions
N, ROWS = 3, 120
KINDS = [(kind, target) for kind in (*PREDICTORS, MIXED) for target in ("error", "position")]


def drawn(kind: str, target: Any) -> tuple[CalibrationModel, Floats]:
    """Draw a model that was trained on what it gives, and signals inside and outside its valid range."""
    rng = np.random.default_rng([len(kind), len(target)])
    signals = 0.3 * rng.normal(size=(ROWS, N + 1))
    model = random_model(kind, signals, rng, joints=N, torques=1, target=target)
    shown = np.abs(model.correct(signals, signals[:, :N])[0]).max(axis=0)
    return replace(model, largest=np.maximum(shown, np.abs(model.offset))), 1.1 * signals


def spoilt(model: CalibrationModel, value: float) -> list[CalibrationModel]:
    """Return models of which one number of a predictor is another: one for each of its arrays."""
    made = []
    for i, group in enumerate(model.groups):
        for name, held in vars(group.predictor).items():
            arrays = [held] if isinstance(held, np.ndarray) else list(held) if isinstance(held, tuple) else []
            for k, array in enumerate(arrays):
                changed = array.copy()
                changed.flat[-1] = value
                new = changed if held is array else (*arrays[:k], changed, *arrays[k + 1 :])
                groups = list(model.groups)
                groups[i] = replace(group, predictor=replace(group.predictor, **{name: new}))
                made.append(replace(model, groups=tuple(groups)))
    return made


def of_ticks(model: CalibrationModel, signals: Floats) -> Given:
    out, flags = ticked(Corrector(model), signals[:, :N], signals)
    return out - signals[:, :N], flags


def of_rows(model: CalibrationModel, signals: Floats) -> Given:
    log = log_of(model.joint_names, model.joint_units, signals, 1)
    return model.calibrate(log) - signals[:, :N], model.correct(signals, signals[:, :N])[1]


def of_c(model: CalibrationModel, signals: Floats, folder: Path) -> Given:
    header = c_header(None, model).text
    body = (
        f"  double out[{N}];\n  int inside[{N}];\n  model_state state;\n  model_reset(&state);\n"
        f"LOOP  model_correct(&state, r, r + {N}, out, inside);\n" + puts(out=N, inside=N)
    )
    columns = output_of(header, body, np.column_stack([signals[:, :N], signals]), folder, "C99")
    return columns[:, :N] - signals[:, :N], columns[:, N:].astype(bool)


def assert_bounded(model: CalibrationModel, given: Given) -> None:
    correction, inside = given
    assert (np.abs(correction) <= MAX_CORRECTION_RATIO * model.largest * (1.0 + 1e-9)).all()  # q + c - q rounds
    offset = np.broadcast_to(model.offset, correction.shape)
    assert_allclose(correction[~inside], offset[~inside], atol=1e-12)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("kind", "target", "value"), [(*case, value) for case, value in zip(KINDS, cycle([1e3, -1e308]), strict=False)]
)
def test_no_number_of_a_model_makes_a_correction_beyond_what_training_showed(kind, target, value) -> None:
    model, signals = drawn(kind, target)
    caught = 0
    for wrong in spoilt(model, value):
        with np.errstate(all="ignore"):
            rows, ticks = (form(wrong, signals) for form in (of_rows, of_ticks))
        for given in (rows, ticks):
            assert_bounded(wrong, given)
            assert_array_equal(given[1], rows[1])
            assert_allclose(given[0], rows[0], rtol=1e-9, atol=1e-9)
        caught += (rows[1] != model.correct(signals, signals[:, :N])[1]).any()
    assert caught > 0


@pytest.mark.alike
@pytest.mark.parametrize(("kind", "target"), KINDS[::3])
def test_exported_c_bounds_corrections_likewise(kind, target, tmp_path: Path) -> None:
    model, signals = drawn(kind, target)
    wrong = replace(spoilt(model, 1e3)[-1], limits=np.outer([-0.5, 0.5], np.ones(N)))
    given, rows = of_c(wrong, signals, tmp_path), of_rows(wrong, signals)
    assert_bounded(wrong, given)
    assert_array_equal(given[1], rows[1])
    assert_allclose(given[0], rows[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("target", ["error", "position"])
def test_correction_beyond_a_joints_limits_by_more_than_any_that_was_shown_is_not_believed(target) -> None:
    model, signals = drawn("linear", target)
    free, inside = of_rows(model, signals)
    lower, upper = np.quantile(signals[:, :N] + free, [0.3, 0.7], axis=0)
    tight = replace(model, limits=np.array([lower + model.largest, upper - model.largest]))
    held = (signals[:, :N] + free >= lower) & (signals[:, :N] + free <= upper)
    assert (inside & ~held).any()
    for form in (of_rows, of_ticks):
        correction, flags = form(tight, signals)
        assert_array_equal(flags, inside & held)
        assert_allclose(correction, np.where(inside & held, free, model.offset), atol=1e-12)


def test_fixed_offset_beyond_the_largest_correction_is_refused() -> None:
    model, _ = drawn("linear", "error")
    with pytest.raises(InputError, match="expected none beyond the largest corrections that training showed"):
        replace(model, offset=10.0 * model.largest)
