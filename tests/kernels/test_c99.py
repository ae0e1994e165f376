"""A line of operations as C, by the compilers that there are."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.lines import gravity_line
from catenary.kernels.c99 import c_function, c_name, c_sines
from catenary.kernels.tracing import evaluate
from catenary.robots.catalog import load_robot
from oracles.random_trees import random_robot


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
