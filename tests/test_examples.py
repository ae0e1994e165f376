import ast
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.robots.dh_table import LinkTable, RobotTable, robot_of_table

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_there_are_examples() -> None:
    assert [path.name[:3] for path in EXAMPLES] == [f"0{k}_" for k in range(1, 10)]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_runs_and_says_what_one_sees(path, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("MPLBACKEND", "agg")
    run_path(str(path), run_name="__main__")
    shown = capsys.readouterr()
    assert shown.out
    assert not shown.err
    text = path.read_text()
    assert text.count("\n") < 60
    assert ast.get_docstring(ast.parse(text))


def test_the_ur5e_is_the_makers_dh_table() -> None:
    alpha = [90, 0, 0, 90, -90, 0]
    a = [0, -0.425, -0.3922, 0, 0, 0]
    d = [0.1625, 0, 0, 0.1333, 0.0997, 0.0996]
    mass = [3.761, 8.058, 2.846, 1.37, 1.3, 0.365]
    com = [(0, -0.02561, 0.00193), (0.2125, 0, 0.11336), (0.15, 0, 0.0265), (0, -0.0018, 0.01634),
           (0, 0.0018, 0.01634), (0, 0, -0.001159)]  # fmt: skip
    # gravity asks for no inertia
    keys = ("alpha_deg", "a_m", "d_m", "mass_kg", "com_m")
    columns = zip(alpha, a, d, mass, com, strict=True)
    rows = [
        LinkTable(name=f"joint{i}", joint="revolute", theta_deg=0.0, **dict(zip(keys, row, strict=True)))
        for i, row in enumerate(columns)
    ]
    table = robot_of_table("ur5e", RobotTable(name="ur5e", convention="standard", sources=[], link=rows))
    arm = load_robot(ROOT / "examples" / "ur5e.urdf")
    rng = np.random.default_rng(0)
    for _ in range(10):
        q, gravity = rng.uniform(-3.0, 3.0, 6), rng.normal(size=3)
        assert_allclose(gravity_torque(arm, q, gravity), gravity_torque(table, q, gravity), atol=1e-6)
        assert_allclose(forward_kinematics(arm, q).position, forward_kinematics(table, q).position, atol=1e-9)
