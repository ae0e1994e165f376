"""A line of operations as machine code: single calls, bound ones, rows; what is refused."""

import pickle
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics import raven_inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.raven_inverse_kinematics import raven_path
from catenary.dynamics.symbolic import gravity_line, mass_matrix_line
from catenary.errors import InputError
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import evaluate_line
from catenary.robots.catalog import load_robot

MODEL = load_robot("raven2")
LINE = gravity_line(MODEL)
Q, GRAVITY = np.array([0.5, 1.6, 0.4]), np.array([0.3, -0.2, -9.81])


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    return Kernel("raven2-gravity", LINE, (3,)).ready()


@pytest.fixture(scope="module")
def states() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rng.normal(size=(259, 3)), 5.0 * rng.normal(size=(259, 3))


@pytest.mark.parametrize("size", [1.0, 1e7, np.nan])
def test_calls_give_what_the_operations_give(kernel: Kernel, states, size: float) -> None:
    for q, gravity in zip(*states, strict=True):
        expected = evaluate_line(LINE, q=size * q, gravity=gravity)
        # angles of 1e7 rad, beyond the quick sines, are rounded to 1e-9; NaN gives NaN
        assert_allclose(kernel(size * q, gravity), expected, rtol=0.0, atol=1e-12 * np.nan_to_num(size))


def test_one_large_angle_leaves_the_others_as_they_are(kernel: Kernel) -> None:
    near = kernel(Q, GRAVITY)
    for k in range(2):
        q = Q.copy()
        q[k] += 2.0 * np.pi * 2**20
        assert_allclose(kernel(q, GRAVITY), near, rtol=0.0, atol=1e-8)  # 2^20 turns are rounded to 1e-9 rad


def test_calls_take_what_numpy_reads_as_numbers(kernel: Kernel) -> None:
    expected, fixed = kernel(Q, GRAVITY), Q.copy()
    fixed.setflags(write=False)
    for given in (list(Q), np.repeat(Q, 2)[::2], fixed, Q.astype(">f8")):
        assert (kernel(given, GRAVITY) == expected).all()
    assert_allclose(kernel([1, 2, 3], [0, 0, -9]), kernel([1.0, 2.0, 3.0], [0.0, 0.0, -9.0]), rtol=0.0)


def test_results_are_new_arrays_of_the_given_shape(kernel: Kernel) -> None:
    first, second = kernel(Q, GRAVITY), kernel(Q, GRAVITY)
    assert not np.shares_memory(first, second)
    assert sys.getrefcount(first) == 2  # the name and the argument
    matrix = Kernel("raven2-mass-matrix", mass_matrix_line(load_robot("raven2")), (3, 3))
    assert_allclose(matrix(Q).ravel(), evaluate_line(matrix.line, q=Q), rtol=1e-12)
    assert matrix.rows(Q[None]).shape == (1, 3, 3)


def test_bound_calls_have_the_bits_of_single_ones(kernel: Kernel, states) -> None:
    q, gravity, out = np.zeros(3), np.zeros(3), np.zeros(3)
    call = kernel.bind(q, gravity, out)
    for k in range(100):
        q[:], gravity[:] = states[0][k], states[1][k]
        call()
        assert (out == kernel(q, gravity)).all()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 7, 64, 259])
def test_many_rows_are_single_ones_to_the_bit(kernel: Kernel, states, count: int) -> None:
    q, gravity = states[0][:count].copy(), states[1][:count]
    q[-1:] *= 1e7  # a large angle among small ones
    for given in (gravity, gravity[:1]) if count > 0 else (np.zeros((1, 3)),):
        expected = [kernel(row, given[k if len(given) > 1 else 0]) for k, row in enumerate(q)]
        out = np.empty((count, 3))
        assert kernel.rows(q, given, out=out) is out
        assert (out == np.array(expected).reshape(-1, 3)).all()


def test_threads_may_call_one_kernel(kernel: Kernel, states) -> None:
    expected = kernel.rows(states[0], GRAVITY[None])
    with ThreadPoolExecutor(4) as pool:
        given = list(pool.map(lambda row: kernel(row, GRAVITY), states[0]))
    assert (np.array(given) == expected).all()


def test_other_arrays_are_refused_by_name(kernel: Kernel) -> None:
    for call in (kernel, kernel.rows):
        with pytest.raises(InputError, match=r"expected 2 arrays \(q, gravity\), got 3"):
            call(Q, GRAVITY, np.zeros(3))
    with pytest.raises(InputError, match=r"q: expected shape \(3,\), got \(2,\)"):
        kernel(Q[:2], GRAVITY)
    with pytest.raises(InputError, match=r"gravity: expected numbers of shape \(3,\)"):
        kernel(Q, "down")
    with pytest.raises(InputError, match=r"gravity: expected shape \(N, 3\), got \(3,\)"):
        kernel.rows(Q[None], GRAVITY)
    with pytest.raises(InputError, match="gravity: expected 1 or 4 rows, got 2"):
        kernel.rows(np.zeros((4, 3)), np.zeros((2, 3)))
    for out, got in ((np.zeros((3, 4)), r"float64 \(3, 4\)"), ([[0.0, 0.0, 0.0]], "list")):
        with pytest.raises(InputError, match=rf"out: expected a contiguous float64 array of shape \(4, 3\), got {got}"):
            kernel.rows(np.zeros((4, 3)), np.zeros((4, 3)), out=out)


@pytest.mark.parametrize(("arrays", "message"), [
    ((Q, GRAVITY), r"expected 3 arrays \(q, gravity, out\), got 2"),
    ((Q[:2], GRAVITY, np.empty(3)), r"q: expected a float64 array of shape \(3,\), got float64 \(2,\)"),
    ((Q, GRAVITY, np.empty((3, 1))), r"out: expected a float64 array of shape \(3,\), got float64 \(3, 1\)"),
    ((Q, GRAVITY.astype(int), np.empty(3)), r"gravity: expected a float64 array .*got int64 \(3,\)"),
    ((list(Q), GRAVITY, np.empty(3)), r"q: expected a float64 array of shape \(3,\), got list"),
    ((Q, GRAVITY, Q), "out: expected memory of its own, got an array that overlaps q"),
])  # fmt: skip
def test_bind_refuses_other_arrays_by_name(kernel: Kernel, arrays, message: str) -> None:
    with pytest.raises(InputError, match=message):
        kernel.bind(*arrays)


def held(kernel: Kernel) -> list[float]:
    """What another process makes of a kernel."""
    torque: list[float] = kernel(Q, GRAVITY).tolist()
    return torque


def test_a_kernel_goes_to_a_process_that_is_spawned(kernel: Kernel) -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(held, kernel).result() == kernel(Q, GRAVITY).tolist()


def test_a_compiled_function_is_pickled_by_its_name() -> None:
    place = forward_kinematics(MODEL, Q)
    for _ in range(2):  # before it is compiled, and after
        again = pickle.loads(pickle.dumps(raven_inverse_kinematics.nearest_within_limits))
        assert again.__name__ == "nearest_within_limits"
        raven_path(MODEL, place.rotation[None], place.position[None])


def test_what_is_bound_is_not_pickled(kernel: Kernel) -> None:
    with pytest.raises(TypeError, match="cannot pickle"):
        pickle.dumps(kernel.bind(Q.copy(), GRAVITY.copy(), np.zeros(3)))
