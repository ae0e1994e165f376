import warnings

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.arrays import (
    as_array,
    as_batch,
    as_not_negative,
    as_positive,
    frozen,
    one_for_all,
    refuse_non_finite,
    spread,
    without_missing,
)
from catenary.errors import InputError


def test_as_array_gives_contiguous_floats_of_the_shape_that_was_asked_for():
    array = as_array("q", np.arange(6).reshape(3, 2).T, (None, 3))
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert_array_equal(array, [[0, 2, 4], [1, 3, 5]])
    assert as_array("dt", 0.5, ()).shape == ()


@pytest.mark.parametrize(
    ("values", "shape", "said"),
    [
        ([1, 2], (3,), r"q: expected shape \(3,\), got \(2,\)"),
        (1.0, (3,), r"expected shape \(3,\), got \(\)"),
        ([1, 2], (), r"expected shape \(\), got \(2,\)"),
        ([[1, 2]], (None, 3), r"expected shape \(N, 3\), got \(1, 2\)"),
        ([], (3,), r"got \(0,\)"),
        ([[1], [1, 2]], (2,), "expected numbers of shape"),
        ("one", (1,), "expected numbers"),
        (["1", "2"], (2,), "expected numbers"),
        (np.array([1j]), (1,), "expected numbers"),
        (None, (1,), "expected shape"),
        ([1, np.nan, np.inf], (3,), r"q\[1\] is nan: expected finite numbers \(2 of 3 values are not\)"),
        ([[0, 0], [0, -np.inf]], (2, 2), r"q\[1, 1\] is -inf"),
        (np.nan, (), "q is nan"),
        (np.array(["1", 2.0], dtype=object), (2,), "expected numbers"),
        (np.array(["2026-01-01", "2026-01-02"], dtype="datetime64[D]"), (2,), "expected numbers"),
        (np.array([1, 2], dtype="timedelta64[s]"), (2,), "expected numbers"),
        (np.ma.array([1.0, 2.0], mask=[False, True]), (2,), "expected numbers"),
    ],
)
def test_as_array_refuses_what_is_not_finite_numbers_of_that_shape(values, shape, said):
    with pytest.raises(InputError, match=said):
        as_array("q", values, shape)


def test_as_array_takes_a_masked_array_that_masks_nothing():
    assert_array_equal(as_array("q", np.ma.array([1.0, 2.0], mask=False), (2,)), [1.0, 2.0])


def test_as_array_lets_infinity_through_where_it_is_allowed():
    assert np.isinf(as_array("limit", [np.inf], (1,), finite=False)).all()


@pytest.mark.parametrize(
    ("check", "refused", "said"),
    [(as_not_negative, [-1e-300, np.nan], "expected zero or more"), (as_positive, [0.0, -1.0], "expected more than 0")],
)
def test_numbers_below_what_they_may_be_are_refused_of_one_joint_as_of_all(check, refused, said):
    assert_array_equal(check("kp", one_for_all(2.0, 3), (3,)), [2.0, 2.0, 2.0])
    for wrong in refused:
        for values in (wrong, [1.0, wrong, 1.0]):
            with pytest.raises(InputError, match=rf"kp.* is nan|kp: {said}"):
                check("kp", one_for_all(values, 3), (3,))
    assert np.isinf(as_not_negative("slew", np.inf, finite=False))


@pytest.mark.parametrize(
    ("values", "shape", "single"),
    [([1, 2, 3], (1, 3), True), ([[1, 2, 3]], (1, 3), False), (np.zeros((0, 3)), (0, 3), False)],
)
def test_a_single_row_becomes_a_batch_of_one_and_a_batch_stays_one(values, shape, single):
    rows, was_single = as_batch("q", values, 3)
    assert (rows.shape, was_single) == (shape, single)


@pytest.mark.parametrize("values", [np.zeros(2), np.zeros((2, 2)), np.zeros((1, 2, 3)), 1.0, "abc"])
def test_as_batch_refuses_rows_of_another_width(values):
    with pytest.raises(InputError, match=r"q: expected .*\(3,\)"):
        as_batch("q", values, 3)


FEW_AND_MANY = pytest.mark.parametrize("pairs", [1, 4, 400])  # they are added up in different ways


@FEW_AND_MANY
def test_sums_that_overflow_or_cancel_neither_warn_nor_hide_infinities(pairs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refuse_non_finite("q", np.full((pairs, 2), 1e308))
        with pytest.raises(InputError, match=rf"q\[0, 0\] is inf.*{2 * pairs} of {2 * pairs}"):
            refuse_non_finite("q", np.tile([np.inf, -np.inf], (pairs, 1)))


def test_only_an_array_that_cannot_be_written_is_copied():
    given = np.arange(3.0)
    assert as_array("q", given, (None,)) is given
    array = as_array("q", frozen(given), (3,))
    assert array.flags.writeable
    assert_array_equal(array, given)


def test_a_frozen_array_is_a_copy_that_cannot_be_written():
    original = np.zeros(2)
    copy = frozen(original)
    original[0] = 1.0
    assert copy[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 2.0


class Recorded:
    """A tensor of torch whose operations are recorded refuses to become an array."""

    requires_grad = True

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")


def test_a_tensor_that_records_gradients_is_refused_with_what_to_do():
    with pytest.raises(InputError, match=r"q: got a tensor that records gradients.*q\.detach\(\).*export_function"):
        as_array("q", Recorded(), (3,))


def test_a_tensor_that_records_none_is_taken():
    class Tensor:
        requires_grad = False

        def __array__(self, dtype=None, copy=None):
            return np.array([1.0, 2.0, 3.0], dtype=np.float32)

    assert_array_equal(as_array("q", Tensor(), (3,)), [1.0, 2.0, 3.0])


JOINT = np.linspace(-170.0, 170.0, 50)


@pytest.mark.parametrize("number", [-999, -9999, 9999, 65535, -32768, 2**31 - 1, -3.697314e28, 1e30, -np.inf, np.nan])
@pytest.mark.parametrize("unit", [1.0, np.pi / 180.0, 2.0])  # the arm's degrees, rad, or millimetres
def test_numbers_that_mean_missing_are_nan_in_any_unit(number: float, unit: float):
    values = np.insert(unit * JOINT, 7, [number, number])
    expected = np.insert(unit * JOINT, 7, [np.nan, np.nan])
    assert_array_equal(without_missing(np.array(values)), expected)
    assert_array_equal(without_missing(np.full(5, float(number))), np.full(5, np.nan))


@pytest.mark.parametrize(
    "values",
    [
        np.arange(0.0, 65536.0, 5.0),  # counts of 16 bits, 65535 among them
        np.arange(-1200.0, 1200.0, 1.0),  # a gantry in mm, or a joint of many turns in deg, through -999
        np.arange(-32768, 32768, 8),
        np.linspace(-9.0e6, 9.0e6, 100),  # counts of 24 bits
    ],
)
def test_numbers_among_their_like_are_kept(values: np.ndarray):
    assert without_missing(values) is values


def test_positions_that_no_joint_reaches_are_missing_but_not_where_most_are_there():
    values = np.append(JOINT, [123_456.0])
    assert_array_equal(without_missing(values, 1.0), np.append(JOINT, [np.nan]))
    counts = 1e3 * JOINT[JOINT > 0.0]  # read as rad: wrong by another fault, which the verdict tells
    assert without_missing(counts, 1.0) is counts


@pytest.mark.parametrize(("count", "most"), [(0, 5), (3, 5), (5, 5), (7, 5), (1_000_000, 1000)])
def test_rows_are_spread_evenly_and_at_random_phases(count, most):
    rows = spread(count, most)
    assert len(rows) == min(count, most)
    assert (np.diff(rows) > 0).all()
    part = count / max(1, len(rows))
    assert (np.abs(rows - part * (np.arange(len(rows)) + 0.5)) <= 0.5 * part + 1.0).all()
    if count > 100 * most:  # each phase of a motion as long as the parts are is met alike
        assert np.histogram(rows % part, 4, (0.0, part))[0].min() > most / 5
