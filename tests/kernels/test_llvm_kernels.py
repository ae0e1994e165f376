import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kernels import gravity_kernel, gravity_module
from catenary.dynamics.traced import gravity_line, mass_matrix_line
from catenary.errors import InputError
from catenary.kernels import kernel_files, llvm_calls, llvm_kernels
from catenary.kernels.array_layout import known_layout
from catenary.kernels.kernel_files import kept_with_digest
from catenary.kernels.llvm_kernels import llvm_kernel, llvm_machine
from catenary.kernels.tracing import evaluate
from catenary.robots.catalog import load_robot
from oracles.random_trees import random_robot
from oracles.wrong_arrays import WRONG_ARRAYS

ROBOT = load_robot("raven2")
LINE = gravity_line(ROBOT)
Q, GRAVITY = np.array([0.5, 1.6, 0.4]), np.array([0.3, -0.2, -9.81])


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A cache of one's own; nothing loaded from it stays in this process."""
    before = dict(llvm_kernels._loaded)
    llvm_kernels._loaded.clear()
    yield tmp_path / "kernels"
    llvm_kernels._loaded.clear()
    llvm_kernels._loaded.update(before)


@pytest.fixture(scope="module")
def both_ways():
    """Calls that look at arrays in machine code, and in Python."""
    by_machine_code = made("robot", LINE, (3,))
    with pytest.MonkeyPatch.context() as patch:
        for module in (llvm_calls, llvm_kernels):
            patch.setattr(module, "known_layout", lambda: False)
        return {"by machine code": by_machine_code, "in Python": made("robot", LINE, (3,))}


def made(stem: str, line, shape: tuple[int, ...], folder: Path | None = None):
    return llvm_kernel(line, shape, llvm_machine(stem, line, shape, folder))


def again(folder: Path):
    """Load as another process would."""
    llvm_kernels._loaded.clear()
    return made("robot", LINE, (3,), folder)


def torque(call) -> np.ndarray:
    out = np.empty(3)
    assert call(Q, GRAVITY, out) is out
    return out


def right(given: np.ndarray) -> bool:
    return bool(np.abs(given - evaluate(LINE, q=Q, gravity=GRAVITY)).max() < 1e-12)


@pytest.mark.parametrize("seed", [8, 17])
def test_calls_give_what_the_operations_give(folder: Path, seed: int) -> None:
    model = random_robot(seed).model
    rng = np.random.default_rng(1)
    for line, shape in ((gravity_line(model), (model.n,)), (mass_matrix_line(model), (model.n, model.n))):
        call, out = made("robot", line, shape, folder), np.empty(shape)
        for size in (1.0, 1e7):  # also beyond the quick sines
            given = {"q": size * rng.normal(size=model.n), "gravity": rng.normal(size=3)}
            inputs = {name: given[name] for name, _ in line.inputs}
            call(*inputs.values(), out)
            # angles of 1e7 rad are rounded to 1e-9
            tolerance = 1e-12 if size == 1.0 else 1e-6
            assert_allclose(out.ravel(), evaluate(line, **inputs), rtol=1e-12, atol=tolerance)


def test_calls_give_the_bits_that_compiled_functions_get(folder: Path) -> None:
    call, compiled, rng = again(folder), gravity_module(ROBOT).into, np.random.default_rng(0)
    ours, theirs = np.empty(3), np.empty(3)
    for size in (1.0, 1e7):
        for _ in range(100):
            q, gravity = size * rng.normal(size=3), rng.normal(size=3)
            call(q, gravity, ours)
            compiled(q, gravity, theirs)
            assert (ours == theirs).all()


def test_one_large_angle_leaves_the_others_as_they_are(folder: Path) -> None:
    call, near, far = again(folder), np.empty(3), np.empty(3)
    for k in range(3):
        q = Q.copy()
        q[k] += 2.0 * np.pi * 2**20 if k < 2 else 0.0
        call(Q, GRAVITY, near)
        call(q, GRAVITY, far)
        assert_allclose(far, near, rtol=0.0, atol=1e-8)  # 2^20 turns are rounded to 1e-9 rad


@pytest.mark.parametrize(
    "wrong",
    WRONG_ARRAYS,
)
@pytest.mark.parametrize("way", ["by machine code", "in Python"])
def test_calls_refuse_what_they_were_not_made_for(both_ways, wrong, way: str) -> None:
    call, x = both_ways[way], np.zeros(3)
    for arguments in ((wrong, x, x), (x, wrong, x), (x, x, wrong)):
        with pytest.raises(InputError, match=r"contiguous float64 arrays of q \(3,\), gravity \(3,\), out"):
            call(*arguments)
    for arguments in ((wrong, x), (x, wrong), (), (x,), (x, x, x, x)):
        with pytest.raises(InputError):
            call(*arguments)
    fixed = np.zeros(3)
    fixed.setflags(write=False)
    call(fixed, fixed, x)
    with pytest.raises(InputError):
        call(x, x, fixed)


@pytest.mark.parametrize("way", ["by machine code", "in Python"])
def test_a_call_without_output_gives_a_new_array(both_ways, way: str) -> None:
    call = both_ways[way]
    first, second = call(Q, GRAVITY), call(Q, GRAVITY)
    assert right(first)
    assert (first == second).all()
    assert not np.shares_memory(first, second)
    assert first.flags.owndata
    assert first.flags.writeable


@pytest.mark.parametrize("way", ["by machine code", "in Python"])
def test_new_arrays_have_the_shape_of_the_result(folder: Path, monkeypatch, way: str) -> None:
    for module in (llvm_calls, llvm_kernels):
        monkeypatch.setattr(module, "known_layout", lambda: way == "by machine code")
    M = made("robot", mass_matrix_line(ROBOT), (3, 3), folder)(Q)
    assert_allclose(M, M.T, rtol=1e-12)
    assert_allclose(M.ravel(), evaluate(mass_matrix_line(ROBOT), q=Q), rtol=1e-12)


def test_new_arrays_are_freed(folder: Path) -> None:
    call = again(folder)
    kept = [call(Q, GRAVITY) for _ in range(10)]
    before = sys.getrefcount(np.dtype("float64"))
    assert [sys.getrefcount(each) for each in kept] == [2 + 1] * 10  # the list, the name and the argument
    for _ in range(1000):
        call(Q, GRAVITY)
    assert abs(sys.getrefcount(np.dtype("float64")) - before) < 50  # of a type that all arrays share


def test_calls_take_no_names(folder: Path) -> None:
    with pytest.raises(TypeError, match="keyword"):
        again(folder)(Q, GRAVITY, out=np.empty(3))


def test_where_arrays_lie_otherwise_they_are_looked_at_in_python(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (llvm_calls, llvm_kernels):
        monkeypatch.setattr(module, "known_layout", lambda: False)
    assert right(torque(again(folder)))
    assert known_layout()


def test_an_input_may_be_the_output(folder: Path) -> None:
    both = Q.copy()
    again(folder)(both, GRAVITY, both)
    assert right(both)


def test_calls_neither_keep_nor_free_what_they_are_given(folder: Path) -> None:
    call, out = again(folder), np.empty(3)
    objects = (Q, GRAVITY, out, None, InputError)
    before = [sys.getrefcount(each) for each in objects]
    for _ in range(1000):
        call(Q, GRAVITY, out)
        with contextlib.suppress(InputError):
            call(Q, GRAVITY, None)
    after = [sys.getrefcount(each) for each in objects]
    assert after[:3] == before[:3]
    assert_allclose(after, before, atol=50)  # None and the error are counted by others too


def test_another_process_finds_the_machine_code(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = torque(again(folder))

    def compile_again(*_args: object) -> bytes:
        raise AssertionError("compiled again")

    monkeypatch.setattr(llvm_kernels, "_compiled", compile_again)
    assert (torque(again(folder)) == first).all()


@pytest.mark.parametrize("harm", ["cut", "planted", "empty", "digest", "no digest", "rights", "link", "gone"])
def test_damaged_or_foreign_machine_code_is_never_loaded(folder: Path, tmp_path: Path, harm: str) -> None:
    again(folder)
    (file,) = folder.glob("robot-*.o")
    digest, whole = file.with_name(f"{file.name}.sha256"), file.read_bytes()
    if harm in ("cut", "planted", "empty"):
        file.write_bytes({"cut": whole[:-8], "planted": whole + b"\x90", "empty": b""}[harm])
    elif harm == "digest":
        digest.write_bytes(b"0" * 64)
    elif harm == "no digest":
        digest.unlink()
    elif harm == "rights":
        file.chmod(0o622)
    elif harm == "link":
        file.rename(tmp_path / "elsewhere.o")
        file.symlink_to(tmp_path / "elsewhere.o")
    else:
        file.unlink()
    assert kept_with_digest(file) is None
    assert right(torque(again(folder)))
    assert kept_with_digest(file) == whole  # made anew, the same
    assert not file.is_symlink()


def test_machine_code_is_readable_and_writable_by_its_owner_only(folder: Path) -> None:
    again(folder)
    files = list(folder.glob("robot-*"))
    assert len(files) == 2
    assert {file.stat().st_mode & 0o777 for file in files} == {0o600}
    assert folder.stat().st_mode & 0o777 == 0o700


def test_without_a_place_to_write_machine_code_is_made_for_this_process(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_bytes(b"")
    assert right(torque(again(tmp_path / "file" / "kernels")))

    def refuse(*_args: object) -> None:
        raise PermissionError("read-only")

    monkeypatch.setattr(kernel_files, "_write", refuse)
    assert right(torque(again(folder)))


def test_machine_code_of_another_robot_or_processor_has_another_name(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digest = llvm_kernels._digest(LINE, (3,))
    assert llvm_kernels._digest(LINE, (3,)) == digest
    assert llvm_kernels._digest(gravity_line(load_robot("planar_3r")), (3,)) != digest
    monkeypatch.setattr(llvm_calls.binding, "get_host_cpu_name", lambda: "another")
    assert llvm_kernels._digest(LINE, (3,)) != digest


def test_machine_code_holds_no_address_of_this_process(folder: Path) -> None:
    code = llvm_kernels._compiled(LINE, (3,))
    for each in (np.ndarray, None, InputError):
        assert id(each).to_bytes(8, sys.byteorder) not in code


def test_robots_kernels_start_without_numba(tmp_path: Path) -> None:
    code = (
        "import sys, numpy as np, catenary\n"
        "from catenary.dynamics.kernels import mass_matrix_kernel\n"
        "from catenary.gravity.torque import gravity_kernel\n"
        "arm = catenary.load_robot('raven2')\n"
        "tau = gravity_kernel(arm)(np.zeros(3), np.array([0.0, 0.0, -9.81]))\n"
        "mass_matrix_kernel(arm)(np.zeros(3))\n"
        "assert not {'numba', 'scipy', 'sklearn'} & set(sys.modules)\n"
        "assert np.abs(tau - catenary.gravity_torque(arm, np.zeros(3), [0.0, 0.0, -9.81])).max() < 1e-12\n"
        "assert 'numba' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_threads_may_call_one_kernel(folder: Path) -> None:
    from concurrent.futures import ThreadPoolExecutor

    kernel, q = gravity_kernel(ROBOT), np.random.default_rng(0).normal(size=(2000, 3))
    expected = [kernel(row, GRAVITY) for row in q]
    with ThreadPoolExecutor(4) as pool:
        given = list(pool.map(lambda row: kernel(row, GRAVITY), q))
    assert (np.array(given) == np.array(expected)).all()
