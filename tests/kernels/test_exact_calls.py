import numpy as np
import pytest

from catenary.kernels.exact_calls import Exact, as_arrays, exact, known_layout, others
from oracles.wrong_arrays import WRONG_ARRAYS

READ, WRITTEN = Exact("float64", (3,), writable=False), Exact("float64", (3,), writable=True)


@exact(READ, WRITTEN, in_memory=True)
def double(x, out):
    if others((x, out)):
        raise ValueError("another array")
    x, out = as_arrays((x, out))
    for k in range(len(x)):
        out[k] = 2.0 * x[k]


def test_arrays_of_the_type_and_shape_are_taken() -> None:
    out = np.empty(3)
    fixed = np.array([1.0, 2.0, 3.0])
    fixed.setflags(write=False)
    double(fixed, out)
    assert (out == [2.0, 4.0, 6.0]).all()
    double(out, out)
    assert (out == [4.0, 8.0, 12.0]).all()


@pytest.mark.parametrize(
    "wrong",
    WRONG_ARRAYS,
)
def test_any_other_argument_is_found_out(wrong) -> None:
    right = np.zeros(3)
    for arguments in ((wrong, right), (right, wrong)):
        with pytest.raises(ValueError, match="another array"):
            double(*arguments)


def test_an_array_that_cannot_be_written_to_is_found_out() -> None:
    fixed = np.zeros(3)
    fixed.setflags(write=False)
    with pytest.raises(ValueError, match="another array"):
        double(np.zeros(3), fixed)


def test_calls_neither_keep_nor_free_what_they_are_given() -> None:
    import sys

    x, out = np.ones(3), np.empty(3)
    before = sys.getrefcount(x), sys.getrefcount(out)
    for _ in range(1000):
        double(x, out)
    assert (sys.getrefcount(x), sys.getrefcount(out)) == before


def test_arrays_of_other_types_and_of_two_axes_are_seen_as_they_are() -> None:
    kinds = (Exact("int64", (2, 3), writable=False), Exact("bool", (2,), writable=False))

    @exact(*kinds, float, result=float, in_memory=True)
    def weigh(rows, chosen, factor):
        if others((rows, chosen)):
            return -1.0
        rows, chosen = as_arrays((rows, chosen))
        total = 0.0
        for k in range(rows.shape[0]):
            if chosen[k]:
                total += rows[k, 1] + 10 * rows[k, 2]
        return factor * total

    rows = np.arange(6).reshape(2, 3)
    assert weigh(rows, np.array([False, True]), 2.0) == 2.0 * (4 + 50)
    assert weigh(np.asfortranarray(rows), np.array([False, True]), 2.0) == -1.0
    assert weigh(rows, np.array([0, 1]), 2.0) == -1.0


def test_arrays_lie_where_numpy_says_that_they_do() -> None:
    assert known_layout()


def test_where_arrays_lie_otherwise_they_are_looked_at_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    from catenary.kernels import exact_calls

    monkeypatch.setattr(exact_calls, "known_layout", lambda: False)
    read, written = Exact("float64", (3,), writable=False), Exact("float64", (3,), writable=True)

    @exact(read, written, in_memory=True)
    def triple(x, out):
        if others((x, out)):
            raise ValueError("another array")
        x, out = as_arrays((x, out))
        for k in range(len(x)):
            out[k] = 3.0 * x[k]

    out = np.empty(3)
    triple(np.array([1.0, 2.0, 3.0]), out)
    assert (out == [3.0, 6.0, 9.0]).all()
    fixed = np.zeros(3)
    fixed.setflags(write=False)
    for x, y in ((np.zeros(6)[::2], out), ([0.0] * 3, out), (out.astype(int), out), (out, fixed)):
        with pytest.raises(ValueError, match="another array"):
            triple(x, y)
