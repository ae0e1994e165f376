"""examples/corrected_positions: a calibration model in a C program of its own."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import simulated_arm
from catenary.calibration.corrector import Corrector
from catenary.calibration.model_file import load_model
from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot
from catenary.workflows.c_header import c_header
from command_line import catenary, refusal
from oracles.calibration_models import ticked

EXAMPLE = Path(__file__).parents[2] / "examples" / "corrected_positions"
PAGE = Path(__file__).parents[2] / "docs" / "deployment.md"


@pytest.mark.skipif(shutil.which("cc") is None or shutil.which("make") is None, reason="no C compiler or make")
def test_the_program_gives_pythons_corrections_motion_by_motion(tmp_path: Path) -> None:
    run, model = simulated_arm.write(tmp_path / "run.npz"), tmp_path / "arm.npz"
    fitted = catenary("fit", run, "--model", "linear", "--play", "0.05,0.2", "--out", model)
    assert fitted.code == 0, fitted
    written = catenary("export", "--model", model, "--rate-hz", 30, "--c", tmp_path / "model.h")
    assert written.code == 0, written
    make = ["make", "-C", EXAMPLE, f"OUT={tmp_path}", f"MODEL={model}", f"{tmp_path}/corrected"]
    built = subprocess.run(make, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    q = read_log(run).q_nominal
    lines = [" ".join(f"{value:.17g}" for value in (*row, *row)) for row in q]
    program = [tmp_path / "corrected"]
    text = "\n".join([*lines, "", *lines[:50], ""])  # an empty line: the first motion again
    ran = subprocess.run(program, input=text, capture_output=True, text=True, check=True)
    given = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float)
    expected, inside = ticked(Corrector(load_model(model)[0], rate_hz=30.0), q, q)
    rows = np.r_[0 : len(q), 0:50]
    assert_allclose(given[:, :3], expected[rows], rtol=0.0, atol=1e-12)
    assert_array_equal(given[:, 3:], inside[rows])
    short = subprocess.run(program, input="1 2\n", capture_output=True, text=True, check=False)
    assert (short.returncode, short.stderr) == (2, "line 1: expected 3 positions and 3 signals\n")


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler")
def test_the_six_lines_on_the_page_of_deployment_give_pythons_correction(model: Path, tmp_path: Path) -> None:
    (code,) = re.findall(r"^```cpp\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "loop.cpp").write_text(code)
    assert catenary("export", "--model", model, "--rate-hz", 1000, "--c", tmp_path / "model.h").code == 0
    strict = ("-std=c++11", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
    subprocess.run(["g++", *strict, "loop.cpp", "-o", "loop"], cwd=tmp_path, check=True)
    lines = subprocess.run([tmp_path / "loop"], capture_output=True, text=True, check=True).stdout.splitlines()
    n = len(load_model(model)[0].joint_names)
    out, inside, interval = np.empty(n), np.empty(n, dtype=bool), np.empty(n)
    Corrector(load_model(model)[0]).correct(np.zeros(n), np.zeros(n), out, inside, interval)
    assert len(lines) == 1000
    assert_allclose(np.array(lines[0].split(), dtype=float), [out[0], interval[0], inside[0]], rtol=1e-8)


def test_a_robot_without_inertia_gives_the_correction_alone_and_says_so(model: Path) -> None:
    calibration, _ = load_model(model)
    alone = c_header(None, calibration)
    assert alone.functions == ("model_reset", "model_correct", "model_interval")
    robot = load_robot("raven2")
    bare = replace(robot, missing_inertia=("wrist",))
    header = c_header(bare, calibration)
    assert header.functions == ("raven2_reset", "raven2_correct", "raven2_interval")
    assert "no inertia for wrist, so without gravity and regressor" in header.notes[0]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    path = folder / "arm.npz"
    line = ("fit", simulated_arm.write(folder / "run.npz"), "--model", "linear", "--out", path)
    assert catenary(*line).code == 0
    return path


def test_export_without_anything_to_write_is_refused() -> None:
    assert "a robot, or --model for its correction alone" in refusal("export", "--c", "a.h")
