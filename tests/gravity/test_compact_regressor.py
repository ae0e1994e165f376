from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser
from numpy.testing import assert_allclose

from catenary.errors import InputError, MissingInertiaError
from catenary.gravity import symbolic_regressor
from catenary.gravity.compact_regressor import compact_regressor, gravity_latex
from catenary.gravity.gravity_regressor import gravity_parameters, gravity_regressor
from catenary.gravity.torque import gravity_torque
from catenary.kernels.tracing import evaluate_line
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.spatial import Pose
from oracles.catalogue import robots_with_inertia
from oracles.latex import value, values
from oracles.random_trees import random_bodies_on, random_inertia, random_robot

PLANAR = load_robot("planar_3r")
UPRIGHT = np.array([0.0, 0.0, -9.81])
X, Y, Z = np.eye(3)


def at(*position: float) -> Pose:
    return Pose(np.eye(3), np.array(position))


def robot_of(*rows: tuple[str, str, str, np.ndarray, Pose], **options) -> RobotModel:
    """Links (name, parent, joint, axis, pose), each with a coordinate and a body of its own."""
    rng = np.random.default_rng(0)
    massless = options.get("massless", ())
    links = [
        Link(name, parent, joint, pose, axis, {name: 1.0}, inertia=None if name in massless else random_inertia(rng))
        for name, parent, joint, axis, pose in rows
    ]
    coordinates = [Coordinate(row[0], "m" if row[2] == "prismatic" else "rad") for row in rows]
    return assemble("made", links, coordinates, **options)


def test_planar_arm_is_printed_as_the_paper_prints_it() -> None:
    regressor = compact_regressor(PLANAR)
    assert str(regressor).split("\n") == [
        "g = g_c [[c1 c12 c123],[0 c12 c123],[0 0 c123]] [s1 s2 s3]^T",
        "s1 = l1 (m2+m3) + lg1 m1",
        "s2 = l2 m3 + lg2 m2",
        "s3 = lg3 m3",
    ]
    first, *parameters = regressor.latex().split("\n")
    assert r"c_{1} & c_{12} & c_{123} \\ 0 & c_{12} & c_{123} \\ 0 & 0 & c_{123}" in first
    assert parameters == [
        "s_{1} = l_{1} (m_{2}+m_{3}) + l_{g1} m_{1}",
        "s_{2} = l_{2} m_{3} + l_{g2} m_{2}",
        "s_{3} = l_{g3} m_{3}",
    ]


def test_compact_form_holds_what_the_full_form_holds(random_robots, rng):
    models = [robot.model for robot in random_robots[:30]] + [load_robot(name) for name in robots_with_inertia()]
    models += [random_bodies_on(load_robot(name), rng).model for name in robot_names()]
    for m in models:
        q, gravity = rng.normal(size=(4, m.n)), 5.0 * rng.normal(size=(4, 3))
        regressor = compact_regressor(m)
        full = gravity_regressor(m, q, gravity) @ gravity_parameters(m).values
        Z = regressor.Z(q, gravity)
        assert_allclose(Z @ regressor.parameters(), full, atol=1e-10, err_msg=m.name)
        assert Z.shape[-1] == len(regressor.labels) == len(regressor.units)
        traced = evaluate_line(regressor.line(), q=q[0], gravity=gravity[0])
        assert_allclose(traced, Z[0].ravel(), rtol=0.0, atol=1e-12, err_msg=m.name)


def test_two_arms_of_the_same_make_stay_apart() -> None:
    rows = [("body", "base", "revolute", Y, at(0, 0, 0.5))]
    rows += [(f"{side} {part}", parent, "revolute", Y, at(*place)) for side, sign in (("left", 1), ("right", -1))
             for part, parent, place in (("upper", "body", (0, 0.2 * sign, 0.4)), ("lower", f"{side} upper", (0, 0, -0.3)))]  # fmt: skip
    m = robot_of(*rows)
    same = m.tree._replace(
        mass=np.full(5, 2.0), com=np.tile([0.0, 0.0, -0.1], (5, 1)), inertia=np.tile(0.1 * np.eye(3), (5, 1, 1))
    )
    arms = replace(m, tree=same)
    regressor = compact_regressor(arms)
    assert len(set(regressor.labels)) == len(regressor.labels)
    # axes all along y: of every first moment only x and z can be felt
    assert len(regressor.labels) == 10
    assert "l1,2z (m2+m3) + l1,4z (m4+m5) + lg1z m1" in regressor.labels
    assert "l2 m3 + lg2z m2" in regressor.labels
    assert "l4 m5 + lg4z m4" in regressor.labels


def test_declared_axes_delete_what_cannot_be_there() -> None:
    anywhere = replace(PLANAR, axes_of_com=np.ones((3, 3), dtype=bool))
    assert compact_regressor(anywhere).labels == (
        "l1 (m2+m3) + lg1x m1",
        "lg1y m1",
        "l2 m3 + lg2x m2",
        "lg2y m2",
        "lg3x m3",
        "lg3y m3",
    )
    # no joint turns about anything but z
    assert compact_regressor(anywhere).ineffective == ("lg1z m1", "lg2z m2", "lg3z m3")


def test_masses_carried_by_a_slide_that_is_massless_are_merged() -> None:
    rows = [
        ("rail", "base", "prismatic", Z, at(0, 0, 0)),
        ("cross", "rail", "prismatic", X, at(0, 0, 0.1)),
        ("head", "cross", "prismatic", Z, at(0, 0.2, 0)),
    ]
    m = robot_of(*rows, massless=["rail", "cross"])
    regressor = compact_regressor(m)
    assert regressor.labels == ("m3",)
    gravity = np.array([1.0, 2.0, -9.0])
    mass = m.tree.mass[2]
    assert_allclose(regressor.Z(np.zeros(3), gravity) @ [mass], [9.0 * mass, -mass, 9.0 * mass], atol=1e-14)
    assert regressor.entries() == [["Z1,1"], ["Z2,1"], ["Z3,1"]]
    assert len(compact_regressor(robot_of(*rows)).labels) == 3


def test_a_slide_moves_the_mass_that_it_carries() -> None:
    m = robot_of(("turn", "base", "revolute", Y, at(0, 0, 0)), ("slide", "turn", "prismatic", X, at(0, 0, 0)))
    regressor = compact_regressor(m)
    assert regressor.labels[-1] == "m2"
    # about y, down is positive for what lies along x
    assert [row[-1] for row in regressor.entries()] == ["-c1 q2", "-s1"]


@pytest.mark.parametrize("name", robot_names())
def test_every_robot_of_the_catalogue_is_printed(name: str) -> None:
    regressor = compact_regressor(load_robot(name))
    lines = str(regressor).split("\n")
    assert max(map(len, lines)) <= 120 or name not in ("planar_3r", "raven2", "two_link")
    for k, label in enumerate(regressor.labels):
        assert f"s{k + 1} = {label}" in lines
    assert set(regressor.symbols)
    assert rf"s_{{{len(regressor.labels)}}} = " in regressor.latex()


def test_parameters_that_no_robot_of_the_structure_has_are_refused() -> None:
    regressor = compact_regressor(PLANAR)
    s = gravity_parameters(PLANAR).values
    with pytest.raises(InputError, match=r"s: expected shape \(36,\), got \(35,\)"):
        regressor.compress(s[1:])
    for entry, number, said in (
        (7, np.nan, r"s\[7\] \(entry 7 of 36\) is nan"),
        (4, 1.0, r"s\[4\] is 1: expected 0"),
        (6, 2.0, r"s\[6\] is 2 and s\[18\] 0.525: expected equal .* l2 m3 \+ lg2 m2"),
    ):
        with pytest.raises(InputError, match=said):
            regressor.compress(np.where(np.arange(36) == entry, number, s))


def test_a_robot_of_another_geometry_or_without_inertia_has_no_parameters() -> None:
    regressor = compact_regressor(load_robot("raven2"))
    with pytest.raises(InputError, match='robot "raven2_right": expected the joints, links and geometry of "raven2"'):
        regressor.parameters(load_robot("raven2_right"))
    with pytest.raises(InputError, match='robot "two_link"'):
        regressor.parameters(load_robot("two_link"))
    with pytest.raises(InputError, match="expected the joints, links and geometry"):
        regressor.parameters(replace(load_robot("raven2"), offset=np.array([0.0, 0.1, 0.0])))
    with pytest.raises(MissingInertiaError, match='"elbow"'):
        regressor.parameters(replace(load_robot("raven2"), missing_inertia=("elbow",)))


def test_a_robot_that_cannot_move_has_no_parameters() -> None:
    m = assemble(
        "still", [Link("a", "base", "revolute", at(0, 0, 0), inertia=random_inertia(np.random.default_rng(0)))], []
    )
    assert compact_regressor(m).labels == ()
    assert str(compact_regressor(m))


def test_kernels_and_many_rows_give_what_one_row_gives(monkeypatch, rng):
    for m in (load_robot("raven2_full"), random_robot(8).model):
        regressor = compact_regressor(m)
        q, gravity = rng.normal(size=(9, m.n)), 5.0 * rng.normal(size=(9, 3))
        expected = regressor.Z(q, gravity)  # in the base frame
        kernel = regressor.kernel()
        given = [kernel(*row) for row in zip(q, gravity, strict=True)]
        out = np.empty_like(given[0])
        (kernel.bind(q[0], gravity[0], out))()
        assert (out == given[0]).all()
        assert_allclose(given, expected, rtol=0.0, atol=1e-12)
        strided = np.repeat(q[0], 2)[::2]
        assert (kernel(strided, gravity[0]) == given[0]).all()
        with monkeypatch.context() as patch:
            patch.setattr("catenary.gravity.compact_regressor.MANY_CONFIGURATIONS", 5)
            assert (regressor.Z(q, gravity) == given).all()
            assert (regressor.Z(q, gravity[0])[0] == given[0]).all()


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
        # six digits a number, steps of shared terms
        assert_allclose(Z, regressor.Z(q, [0.0, 0.0, -1.0]), atol=1e-4)
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
    assert_allclose(regressor.Z(q, gravity) @ regressor.parameters(arm), gravity_torque(arm, q, gravity), atol=1e-4)
    # numbers are those of the file, the regressor's of the quarter turns
    assert symbolic_regressor._ROUNDING < abs(arm.tree.rotation[1][1, 1]) < 1e-6


def held(text: str, q: np.ndarray) -> list[float]:
    named = values(text.split("\n"), q)
    return [named[f"g_{{{j + 1}}}"] for j in range(len(q))]


@pytest.mark.parametrize("name", robots_with_inertia())
def test_formulas_give_the_torques_of_every_robot(name: str) -> None:
    model, rng = load_robot(name), np.random.default_rng(3)
    for gravity in ([0.0, 0.0, -9.81], [1.0, -2.0, -9.0]):
        text = gravity_latex(model, gravity)
        q = rng.uniform(-1.0, 1.0, model.n)
        expected = gravity_torque(model, q, gravity)
        # six digits a number, of sums of up to a hundred and some
        assert_allclose(held(text, q), expected, atol=2e-4 * max(1.0, np.abs(expected).max()))


def test_a_ur10e_is_written_in_six_short_lines_that_latex_reads() -> None:
    lines = gravity_latex(load_robot("ur10e")).split("\n")
    assert len(lines) == 6
    assert max(map(len, lines)) < 90
    assert lines[0] == "g_{1} = 0"  # a vertical axis
    parser = MathTextParser("path")
    for line in lines:
        parser.parse(f"${line}$")


def test_a_robot_without_masses_has_no_formulas_of_them() -> None:
    with pytest.raises(MissingInertiaError):
        gravity_latex(load_robot("dvrk_psm_motors"))
