"""The C program on the page of kernels: exported, compiled and run as the page says."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.robots.catalog import load_robot
from command_line import catenary

PAGE = Path(__file__).parents[2] / "docs" / "kernels.md"
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_program_on_the_page_gives_pythons_torques(tmp_path: Path) -> None:
    (code,) = re.findall(r"^```c\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "roll.c").write_text(code)
    assert catenary("export", "raven2", "--c", tmp_path / "raven2.h").code == 0
    subprocess.run(["cc", *STRICT, "roll.c", "-lm", "-o", "roll"], cwd=tmp_path, check=True)
    ran = subprocess.run([tmp_path / "roll"], capture_output=True, text=True, check=True)
    tau = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float)
    t = 0.001 * np.arange(1000)
    zero, roll = 0.0 * t, 0.1 * np.sin(t)
    q = np.column_stack([0.5 + 0.2 * np.sin(2.0 * t), zero + 1.6, zero + 0.4])
    qd = np.column_stack([0.4 * np.cos(2.0 * t), zero, zero])
    qdd = np.column_stack([-0.8 * np.sin(2.0 * t), zero, zero])
    gravity = np.column_stack([zero, -9.81 * np.sin(roll), -9.81 * np.cos(roll)])
    base = BaseMotion(np.column_stack([0.1 * np.cos(t), zero, zero]), np.column_stack([-0.1 * np.sin(t), zero, zero]))
    expected = inverse_dynamics(load_robot("raven2"), q, qd, qdd, gravity, base)
    assert_allclose(tau, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
