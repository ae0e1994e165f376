import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kernels import (
    forward_kinematics_kernel,
    gravity_kernel,
    inverse_dynamics_kernel,
    mass_matrix_kernel,
)
from catenary.dynamics.traced import gravity_line
from catenary.errors import InputError
from catenary.kernels import c_compiler
from catenary.kernels.c_compiler import load_extension
from catenary.kernels.c_source import c_function, c_name, c_sines
from catenary.kernels.kernel_files import kept_with_digest
from catenary.kernels.tracing import evaluate
from catenary.robots.catalog import load_robot
from oracles.random_trees import random_robot

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
MODELS = [load_robot("raven2_full"), load_robot("two_link"), random_robot(8).model, random_robot(17).model]
OTHER = load_robot("planar_3r")  # nothing else here compiles it


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    before = set(sys.modules)
    yield tmp_path / "kernels"
    for name in set(sys.modules) - before:
        if name.startswith("_catenary_c_kernel_"):
            del sys.modules[name]


@needs_compiler
@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_the_compilers_kernels_are_llvms_to_the_bit(model) -> None:
    rng = np.random.default_rng(1)
    for make in (gravity_kernel, mass_matrix_kernel, inverse_dynamics_kernel, forward_kinematics_kernel):
        ours, theirs = make(model, backend="c"), make(model)
        assert (ours.backend, theirs.backend) == ("c", "llvm")
        widths = {gravity_kernel: (model.n, 3), inverse_dynamics_kernel: (model.n, model.n, model.n, 3)}
        for size in (1.0, 1e7):  # also beyond the quick sines
            for _ in range(50):
                arrays = [size * rng.normal(size=width) for width in widths.get(make, (model.n,))]
                assert (ours(*arrays) == theirs(*arrays)).all()


@needs_compiler
@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(2),
        np.zeros(4),
        np.zeros((3, 1)),
        np.zeros(3, dtype=np.float32),
        np.zeros(3, dtype=np.int64),
        np.zeros(6)[::2],
        np.zeros(3).astype(">f8"),
        [0.0, 0.0, 0.0],
        None,
    ],
)
def test_the_compilers_kernels_refuse_what_they_were_not_made_for(wrong) -> None:
    kernel, right = gravity_kernel(load_robot("raven2"), backend="c"), np.zeros(3)
    for arguments in ((wrong, right, right), (right, wrong, right), (right, right, wrong)):
        with pytest.raises(InputError, match=r"contiguous float64 arrays of q \(3,\)"):
            kernel.into(*arguments)
    frozen = np.zeros(3)
    frozen.setflags(write=False)
    kernel.into(frozen, frozen, right)
    with pytest.raises(InputError):
        kernel.into(right, right, frozen)
    assert (kernel.into(right, right) == gravity_kernel(load_robot("raven2"))(right, right)).all()
    for arguments in ((right,), (frozen[:2], right), (right, right, right, right)):
        with pytest.raises(InputError):
            kernel.into(*arguments)


def test_without_a_compiler_or_headers_llvm_makes_the_kernel(
    monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    line = gravity_line(OTHER)
    monkeypatch.setattr(c_compiler, "COMPILERS", ())
    assert load_extension("robot", line, (3,), folder) is None
    monkeypatch.undo()
    monkeypatch.setattr(c_compiler.sysconfig, "get_path", lambda name: str(folder))
    assert load_extension("robot", line, (3,), folder) is None
    monkeypatch.setattr(c_compiler, "load_extension", lambda *_: None)
    kernel = gravity_kernel(load_robot("two_link"), backend="c")
    assert kernel.backend == "llvm"
    assert kernel(np.zeros(2), np.ones(3)).shape == (2,)


@needs_compiler
@pytest.mark.parametrize("harm", ["library", "digest", "rights", "link", "both but for the digest"])
def test_a_damaged_or_foreign_library_is_never_loaded(folder: Path, harm: str, tmp_path: Path) -> None:
    line = gravity_line(OTHER)
    module = load_extension("robot", line, (3,), folder)
    assert module is not None
    (library,) = folder.glob("robot-*.so")
    del sys.modules[module.__name__]
    whole = library.read_bytes()
    if harm == "library":
        library.unlink()  # it is mapped into this process: writing into it would crash us
        library.write_bytes(b"\x7fELF planted")
        library.chmod(0o600)
    elif harm == "digest":
        library.with_name(f"{library.name}.sha256").write_bytes(b"0" * 64)
    elif harm == "rights":
        library.chmod(0o666)
    elif harm == "link":
        library.rename(tmp_path / "elsewhere.so")
        library.symlink_to(tmp_path / "elsewhere.so")
    else:
        library.unlink()
    assert kept_with_digest(library) is None
    assert load_extension("robot", line, (3,), folder) is not None
    assert library.read_bytes()[:4] == whole[:4]
    assert kept_with_digest(library) is not None
    assert library.stat().st_mode & 0o777 == 0o600


@needs_compiler
def test_a_compiler_that_fails_does_no_harm(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setattr(c_compiler, "extension_source", lambda *_: "this is no C")
    assert load_extension("robot", gravity_line(OTHER), (3,), folder) is None
    assert list(folder.glob("*.so")) == []


@needs_compiler
@pytest.mark.parametrize("compiler", [("gcc", "-std=c99", "-x", "c"), ("g++", "-std=c++11", "-x", "c++")])
def test_functions_compile_without_a_warning_as_c_and_cpp(compiler: tuple[str, ...], tmp_path: Path) -> None:
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"{compiler[0]} is not installed")
    model = random_robot(8).model
    line = gravity_line(model)
    (tmp_path / "robot.h").write_text(
        "#include <math.h>\n" + c_sines("arm") + c_function("arm", "gravity", line)
    )
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "robot.h"\nint main(void) {\n'
        f"  double q[{model.n}], g[3], tau[{model.n}];\n  int i;\n"
        f"  while (fread(q, sizeof(double), {model.n}, stdin) == {model.n} && fread(g, sizeof(double), 3, stdin) == 3) {{\n"
        f'    arm_gravity(q, g, tau);\n    for (i = 0; i < {model.n}; ++i) printf("%.17g ", tau[i]);\n  }}\n  return 0;\n}}\n'
    )
    strict = ["-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    program = tmp_path / "main"
    subprocess.run(
        [*compiler, *strict, str(tmp_path / "main.c"), "-x", "none", "-lm", "-o", str(program)], check=True
    )
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(100, model.n + 3))
    given = subprocess.run([program], input=rows.tobytes(), capture_output=True, check=True).stdout
    expected = [evaluate(line, q=row[: model.n], gravity=row[model.n :]) for row in rows]
    assert_allclose(np.array(given.split(), dtype=float).reshape(100, -1), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "name"),
    [("raven2", "raven2"), ("Panda (left)", "panda_left"), ("2 link", "robot_2_link"), ("", "robot")],
)
def test_names_become_names_of_c(text: str, name: str) -> None:
    assert c_name(text) == name
    assert replace(load_robot("raven2"), name=text).name == text
