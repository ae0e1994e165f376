"""examples/raven_firmware: the exported model in the place of the RAVEN-II's own gravity compensation."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.firmware import NOMINAL_GRAV_DIR, ControlState, OwnGravity, gravity_of, write_gravity_torque
from catenary.workflows.c_header import c_header

EXAMPLE = Path(__file__).parents[2] / "examples" / "raven_firmware"
POSES = 300
# the robot's code, from grav_dir (x, y, z) in cm/s2 to m/s2 in frame 0 of each arm; so do its paper's figures
FRAME_0 = {
    "raven2": np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]) / 100.0,
    "raven2_right": np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]) / 100.0,
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, compiled by its own Makefile against headers exported here."""
    if shutil.which("g++") is None or shutil.which("make") is None:
        pytest.skip("g++ or make is not installed")
    out = tmp_path_factory.mktemp("raven_firmware")
    for name in FRAME_0:
        (out / f"{name}.h").write_text(c_header(load_robot(name)).text)
    built = subprocess.run(
        ["make", "-C", EXAMPLE, f"OUT={out}", f"{out}/try"], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    return out / "try"


@pytest.fixture(scope="module")
def rows() -> Floats:
    """Poses within the limits, as floats, and gravity of any direction in whole cm/s2: (N, 6)."""
    rng = np.random.default_rng(3)
    q = rng.uniform([0.0, 0.8, 0.23], [1.57, 2.3, 0.56], (POSES, 3)).astype(np.float32)
    return np.column_stack([q, np.round(980.0 * rng.normal(size=(POSES, 3)))])


def test_torques_are_pythons_for_both_arms_whatever_the_gravity(
    program: Path, rows: Floats, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "\n".join(" ".join(f"{number:.9g}" for number in row) for row in rows)
    ran = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    with capsys.disabled():
        sys.stdout.write(f"\ngrav_comp.cpp: {ran.stderr.strip()}\n")
    given = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float).reshape(POSES, 2, 6)
    firmware = load_cable_arm().firmware
    for arm, name in enumerate(FRAME_0):
        model = load_robot(name)
        frame_0 = load_robot(name.replace("raven2", "raven2_full")).frames["frame0"].pose.rotation
        gravity = rows[:, 3:] @ FRAME_0[name].T @ frame_0.T
        expected = gravity_torque(model, rows[:, :3], gravity)
        assert_allclose(given[:, arm, :3], expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
        # tau_g is a float, and the ratios of the stand-in have seven digits
        motors = expected / firmware.ratio[:3] * firmware.gearbox[:3]
        assert_allclose(given[:, arm, 3:], motors, rtol=0.0, atol=1e-6 * np.abs(motors).max())


def test_page_has_the_torques_that_the_file_and_the_robots_own_compensation_give_at_home(program: Path) -> None:
    page = (EXAMPLE.parents[1] / "docs" / "how-to-raven-firmware.md").read_text()
    (told,) = re.findall(r"the same numbers: (-?\+?[\d.]+), (-?\+?[\d.]+), ([-+]?[\d.]+) Nm", page)
    home = np.array([np.deg2rad(30.0), np.deg2rad(90.0), 0.40])
    row = " ".join(f"{number:.9g}" for number in (*home, *NOMINAL_GRAV_DIR))
    ran = subprocess.run([program], input=row, capture_output=True, text=True, check=True)
    by_file = np.array(ran.stdout.split(), dtype=float).reshape(2, 6)[:, 3:]
    firmware = load_cable_arm().firmware
    for arm, name in enumerate(FRAME_0):
        own, control = OwnGravity(), ControlState()
        own.gravity, control.joint[:3] = gravity_of(NOMINAL_GRAV_DIR), home
        write_gravity_torque(firmware, load_robot(name).tree, own, control)
        for given in (by_file[arm], control.gravity_torque[:3]):
            assert_allclose(given, np.array(told, dtype=float), rtol=0.0, atol=0.5e-4)  # four digits
