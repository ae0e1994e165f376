from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.features import FeatureSet
from catenary.calibration.model import CalibrationModel, JointGroup, Target
from catenary.calibration.predictors import linear
from catenary.calibration.valid_range import ValidRange
from catenary.errors import InputError
from recordings import recording

OFFSET = np.array([0.5, -0.25])
INPUTS = FeatureSet(("q:J1", "q:J2"), ("rad", "m"))


def unit_box(count: int) -> ValidRange:
    ones = np.ones(count)
    return ValidRange(-ones, ones, 0.0 * ones, np.eye(count), -ones, ones)


def one_of_each(target: Target = "error") -> CalibrationModel:
    """J1 takes both inputs, J2 only its own; each within [-1, 1]."""
    both, own = np.array([0, 1]), np.array([1])
    return CalibrationModel(
        kind="linear",
        preset=None,
        joint_names=("J1", "J2"),
        joint_units=("rad", "m"),
        features=INPUTS,
        target=target,
        offset=OFFSET,
        largest=np.array([10.0, 10.0]),
        groups=(
            JointGroup((0,), both, linear(np.array([[2.0], [3.0]]), np.array([1.0])), unit_box(2), both),
            JointGroup((1,), own, linear(np.array([[4.0]]), np.array([0.0])), unit_box(1), own),
        ),
    )


@pytest.mark.parametrize(
    ("features", "correction", "inside"),
    [
        ([0.1, 0.2], [1.0 + 2.0 * 0.1 + 3.0 * 0.2, 4.0 * 0.2], [True, True]),
        ([1.5, 0.2], [OFFSET[0], 0.8], [False, True]),
        ([np.nan, 0.2], [OFFSET[0], 0.8], [False, True]),
        ([0.0, -1.5], OFFSET, [False, False]),
    ],
    ids=["inside", "outside for one", "missing for one", "outside for both"],
)
def test_each_group_corrects_its_joints_or_falls_back_to_its_offset(features, correction, inside) -> None:
    X = np.array([features])
    assert_allclose(one_of_each().correction(X, np.zeros((1, 2))), [correction], rtol=1e-15)
    assert_array_equal(one_of_each().inside(X), [inside])


def test_position_that_a_model_gives_end_to_end_becomes_a_correction_and_an_offset_is_one() -> None:
    X, q, model = np.array([[0.1, 0.2]]), np.array([[0.3, 0.7]]), one_of_each("position")
    assert_allclose(model.correction(X, q) + q, one_of_each("error").correction(X, q), rtol=1e-15)
    assert_array_equal(model.correction(np.full((1, 2), 9.0), np.ones((1, 2))), OFFSET[None])


@pytest.mark.parametrize(
    "change", [{"joint_names": ("J2", "J3")}, {"joint_units": ("rad", "rad")}], ids=["names", "units"]
)
def test_recording_of_other_joints_is_refused_with_both(change: dict[str, tuple[str, ...]]) -> None:
    log = replace(recording(np.random.default_rng(0), rows=5, units=("rad", "m")), **change)
    with pytest.raises(InputError, match=r'"run" has .*it has .*, the model is for J1 \[rad\], J2 \[m\]'):
        one_of_each().calibrate(log)


@pytest.mark.parametrize(("features", "q"), [((4, 3), (4, 2)), ((2,), (1, 2)), ((4, 2), (3, 2)), ((4, 2), (4, 1))])
def test_arrays_of_another_shape_are_refused(features: tuple[int, ...], q: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="expected shape"):
        one_of_each().correction(np.zeros(features), np.zeros(q))


def with_group(**changes: Any) -> CalibrationModel:
    model = one_of_each()
    return replace(model, groups=(replace(model.groups[0], **changes), model.groups[1]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: with_group(predictor=linear(np.zeros((3, 1)), np.zeros(1))),
            "take 2 features, .* the predictor takes 3",
        ),
        (lambda: with_group(predictor=linear(np.zeros((2, 2)), np.zeros(2))), "the predictor takes 2 and gives 2"),
        (lambda: with_group(valid_range=unit_box(1)), "2 of them watched; .* the valid range is of 1"),
        (lambda: with_group(columns=np.array([1, 2])), r"joints \(0,\) take features beyond the 2 that there"),
        (lambda: with_group(columns=np.array([0.0, 1.0])), "columns: expected indices of features"),
        (lambda: with_group(joints=(1,)), "each of its 2 joints in one group"),
        (lambda: linear(np.zeros((4, 2)), np.zeros(3)), r"weights: expected shape \(4, 3\), got \(4, 2\)"),
        (lambda: linear(np.full((4, 2), np.nan), np.zeros(2)), r"weights\[0, 0\] is nan"),
        (lambda: replace(unit_box(3), lower=np.zeros(2)), r"upper: expected shape \(2,\), got \(3,\)"),
        (lambda: replace(one_of_each(), offset=np.zeros(3)), r"offset: expected shape \(2,\)"),
        (lambda: replace(one_of_each(), target="torque"), "target 'torque': expected error or position"),
    ],
)
def test_parts_that_do_not_fit_together_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
