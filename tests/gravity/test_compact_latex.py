"""The regressor's LaTeX read back: what stands on paper gives the numbers."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from catenary.gravity import terms
from catenary.gravity.compact import compact_regressor
from catenary.robots.catalog import load_robot
from oracles.latex import value, values
from oracles.random_trees import random_robot


def assert_paper_gives_numbers(model, rng) -> str:
    regressor = compact_regressor(model)
    text = regressor.latex()
    first, *defined = text.split("\n")
    body = first.split(r"\begin{bmatrix}")[1].split(r"\end{bmatrix}")[0]
    table = [[cell.strip() for cell in row.split(" & ")] for row in body.split(r"\\")]
    lines = [line for line in defined if not line.startswith("s_")]
    assert len({line.split(" = ")[0] for line in lines}) == len(lines)  # each is defined once
    for q in rng.uniform(-1.0, 1.0, size=(2, model.n)):
        named = values(lines, q)
        Z = [[named[cell] if cell in named else value(cell, q) for cell in row] for row in table]
        assert_allclose(
            Z, regressor.Z(q, [0.0, 0.0, -1.0]), atol=1e-4
        )  # six digits a number, steps of shared terms
    return text


@pytest.mark.parametrize("name", ["raven2", "planar_3r", "panda", "ur10e", "iiwa14", "gen3"])
def test_a_whole_regressor_on_paper_gives_its_numbers(name, rng):
    assert r"\gamma" not in assert_paper_gives_numbers(load_robot(name), rng)  # it is written out


def test_arms_of_any_twists_are_whole_in_shared_terms(rng):
    # joints askew to each other fill every entry; prismatic, coupled and branching ones are among them
    texts = [assert_paper_gives_numbers(random_robot(seed).model, rng) for seed in range(12)]
    assert any(r"\gamma" in text for text in texts)


def test_quarter_turns_of_few_digits_are_exact_on_paper(tmp_path: Path, rng) -> None:
    links = "".join(
        f'<link name="l{k}"><inertial><origin xyz="0.1 0.02 0.05"/><mass value="1"/><inertia ixx="0.1" ixy="0" '
        'ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
        for k in range(4)
    )
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0 0 0.3" '
        f'rpy="{roll} 0 0"/><axis xyz="0 0 1"/></joint>'
        for k, roll in enumerate(("0", "1.570796", "-1.570796"))
    )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{links}{joints}</robot>')
    arm = load_robot(path)
    text = assert_paper_gives_numbers(arm, rng)
    assert "e-" not in text
    regressor = compact_regressor(arm)
    q, gravity = [0.3, -0.4, 1.0], [1.0, 2.0, -9.0]
    from catenary.gravity.torque import gravity_torque

    assert_allclose(
        regressor.Z(q, gravity) @ regressor.parameters(arm), gravity_torque(arm, q, gravity), atol=1e-4
    )
    # numbers are those of the file, the regressor's of the quarter turns
    assert terms.ROUNDING < abs(arm.tree.rotation[1][1, 1]) < 1e-6
