"""Joints that one motor moves together and loops that a table closes, against MuJoCo's equalities."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.errors import CatenaryError, UnsupportedModelError
from catenary.gravity.closed_robot import load_closed_robot
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from command_line import catenary, refusal
from oracles.mujoco_loops import held

SEGMENTS = ("l3", "l2", "l1", "l0")


def telescope(mimic=""):
    """Return a URDF of a lift with a telescope of four segments, as Stretch's; `mimic` is of the last three."""
    out, parent = "", "mast"
    for k, name in enumerate(("lift", *SEGMENTS)):
        axis = "0 0 1" if name == "lift" else "0 1 0.1"
        follows = mimic if k > 1 else ""
        out += f"""<link name="{name}_link"><inertial><origin xyz="0.01 0.1 0.02"/><mass value="{0.5 + 0.1 * k}"/>
          <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
          <joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{name}_link"/><axis xyz="{axis}"/>
          <limit lower="0" upper="0.13" effort="100" velocity="1"/><dynamics friction="2" damping="{k}"/>{follows}</joint>"""
        parent = f"{name}_link"
    return f'<robot name="stretch"><link name="mast"/>{out}</robot>'


COUPLED = """
description = "stretch.urdf"
[[coordinate]]
name = "arm"
unit = "m"
moves = { l3 = 0.25, l2 = 0.25, l1 = 0.25, l0 = 0.25 }
"""


@pytest.fixture
def load(tmp_path):
    def load_table(urdf, text, loader=load_robot):
        (tmp_path / "stretch.urdf").write_text(urdf)
        (tmp_path / "arm.toml").write_text(text)
        return loader(tmp_path / "arm.toml")

    return load_table


def test_a_telescope_is_one_coordinate_by_mimic_joints_and_by_a_table(load, rng):
    table = load(telescope(), COUPLED)
    mimic = load(telescope('<mimic joint="l3"/>'), 'description = "stretch.urdf"')
    assert (table.joint_names, mimic.joint_names) == (("lift", "arm"), ("lift", "l3"))
    assert_allclose([table.upper, mimic.upper], [[0.13, 0.52], [0.13, 0.13]])
    assert_allclose(table.velocity_limit, [1.0, 4.0])
    bodies = "".join(
        f'<body><joint name="{name}" type="slide" axis="{"0 0 1" if name == "lift" else "0 1 0.1"}"/>'
        f'<inertial pos="0.01 0.1 0.02" mass="{0.5 + 0.1 * k}" diaginertia="0.01 0.01 0.01"/>'
        for k, name in enumerate(("lift", *SEGMENTS))
    )
    text = (
        f"<mujoco><worldbody>{bodies}{'</body>' * 5}</worldbody><equality>"
        + "".join(f'<joint joint1="{name}" joint2="l3"/>' for name in SEGMENTS[1:])
        + "</equality></mujoco>"
    )
    for _ in range(5):
        lift, out = rng.uniform(0.0, 0.13, 2)
        g = rng.normal(size=3) * 6.0
        oracle = held(text, ["lift", "l3"], {"lift": lift} | dict.fromkeys(SEGMENTS, out), g)
        assert_allclose(gravity_torque(mimic, [lift, out], g), oracle.torque, atol=1e-8)
        assert_allclose(gravity_torque(table, [lift, 4.0 * out], g), oracle.torque / [1.0, 4.0], atol=1e-8)
        assert_allclose(mass_matrix(table, [lift, 4.0 * out]), oracle.mass / [[1, 4], [4, 16]], atol=1e-8)
    moving = np.array([[0.0, 0.0]]), np.array([[1.0, 4.0]]), np.zeros((1, 2))
    asked = [known_loads(model).torque(moving[0], moving[1] / scale, moving[2]) for model, scale in
             ((table, 1.0), (mimic, [1.0, 4.0]))]  # fmt: skip
    assert_allclose(asked[0], [[2.0, 4.5]])
    assert_allclose(asked[1], [[2.0, 18.0]])


def test_friction_of_joints_that_move_together_is_one_of_their_coordinate(load):
    table = load(telescope(), COUPLED)
    assert [friction.name for friction in table.actuation.friction] == ["lift", "l3"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (COUPLED.replace("l0 =", "l9 ="), 'coordinate "arm": moves no joint "l9"; joints: lift, l3, l2, l1, l0'),
        (COUPLED.replace('"arm"', '"lift"'), "coordinate names must differ"),
        (COUPLED + "limits_deg = [0, 1]\n", '"arm" is in m: expected limits_m'),
        ('description = "stretch.urdf"\nmotors = ["lift"]', "motors: the robot has no loop"),
        ('description = "stretch.urdf"\nassembled_m = { lift = 0.1 }', "assembled: expected with a loop"),
        ('description = "stretch.urdf"\nmotors = ["lift"]\nassembled_deg = { lift = 9 }', '"lift" is in m: expected assembled_m'),
        ('description = "stretch.urdf"\n[[loop]]\nname = "a"\nframes = ["l0_link", "x"]', 'no frame "x"'),
        ('description = "stretch.urdf"\nmotors = ["x"]\n[[loop]]\nname = "a"\nframes = ["l0_link", "mast"]',
         'loop: unknown joint "x"'),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused_by_name(load, text, said):
    with pytest.raises(CatenaryError, match=re.escape(said)):
        load(telescope(), text)


ROW = """
[[link]]
name = "{}"
joint = "revolute"
theta_deg = 0
d_m = 0
alpha_deg = {}
a_m = {}
mass_kg = {}
com_m = {}
"""
LINKS = (
    ("crank", 90, 0, 1.0, [0.1, 0.01, 0]),
    ("coupler", 0, 0.2, 0.7, [0.25, 0, 0.02]),
    ("rocker", 90, 0.5, 0.8, [0.15, 0, 0]),
)
ROWS = """
name = "four_bar"
convention = "modified"
sources = ["assumed"]
motors = ["crank"]
{rest}
""" + "".join(ROW.format(*link) for link in LINKS) + """parent = "base"

[[loop]]
name = "pin"
frames = ["coupler", "rocker"]
points_m = [[0.5, 0, 0], [0.3, 0, 0]]
"""  # fmt: skip
# the same: frames of the rows turn about -y of the base
SITE = '<site name="{}" pos="{} 0 0"/>'
BARS = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="c"><joint name="crank" axis="0 -1 0"/><inertial pos="0.1 0 0.01" mass="1" diaginertia="1 1 1"/>
<body name="d" pos="0.2 0 0"><joint name="coupler" axis="0 -1 0"/>{SITE.format("one", 0.5)}
<inertial pos="0.25 -0.02 0" mass="0.7" diaginertia="1 1 1"/></body></body>
<body name="r" pos="0.5 0 0"><joint name="rocker" axis="0 -1 0"/>{SITE.format("other", 0.3)}
<inertial pos="0.15 0 0" mass="0.8" diaginertia="1 1 1"/></body></worldbody>
<equality><connect site1="one" site2="other"/></equality></mujoco>"""


@pytest.mark.parametrize(("branch", "coupler", "rocker"), [(1, -50.0, 70.0), (-1, -115.0, -125.0)])
def test_a_four_bar_in_a_table_holds_what_mujocos_does_however_it_is_assembled(tmp_path, rng, branch, coupler, rocker):
    where = f"crank = 60, coupler = {coupler}, rocker = {rocker}"
    (tmp_path / "four_bar.toml").write_text(ROWS.format(rest=f"assembled_deg = {{ {where} }}"))
    robot = load_closed_robot(tmp_path / "four_bar.toml")
    for q in rng.uniform(0.6, 1.3, (4, 1)):
        x, g = dict(zip(robot.opened.joint_names, robot.positions(q), strict=True)), rng.normal(size=3)
        turn, t = x["crank"] + x["coupler"], x["rocker"]
        tip = 0.2 * np.exp(1j * q[0]) + 0.5 * np.exp(1j * turn)
        assert tip == pytest.approx(0.5 + 0.3 * np.exp(1j * t), abs=1e-11)
        assert np.sign(np.sin(t - turn)) == branch
        oracle = held(BARS, ["crank"], x, g)
        assert oracle.gap < 1e-9
        assert_allclose(robot.gravity_torque(q, g), oracle.torque, atol=1e-8)


def test_the_command_gravity_holds_a_four_bar_by_its_motor_and_others_refuse_it(tmp_path):
    path, where = tmp_path / "four_bar.toml", "crank = 60, coupler = -50, rocker = 70"
    path.write_text(ROWS.format(rest=f"assembled_deg = {{ {where} }}"))
    for options, place in ((("--q", "0.9"), 0.9), (("--q-deg", "60", "--payload", "0"), np.deg2rad(60.0))):
        found = catenary("gravity", path, *options, "--base-tilt-deg", "10,0", "--json").json
        assert found["joints"] == ["crank"]
        expected = load_closed_robot(path).gravity_torque([place], found["gravity"])
        assert_allclose(found["tau"], expected, atol=1e-12)
    heavier = catenary("gravity", path, "--q", "0.9", "--payload", "1", "--payload-on", "coupler", "--json").json
    assert abs(heavier["tau"][0] - heavier["level"][0]) < 1e-12 < abs(heavier["tau"][0] - found["level"][0])
    assert "four_bar: what holds it still" in catenary("gravity", path, "--q", "0.9").out
    assert "not for closed loops" in refusal("gravity", path, "--latex")
    assert "four_bar: give its 1 joints" in refusal("gravity", path)
    for command in (("export", path, "--c", tmp_path / "a.h"), ("regressor", path)):
        assert "catenary gravity and catenary.load_closed_robot have its torques" in refusal(*command)


def test_a_loop_that_closes_far_from_where_it_is_said_to_be_assembled_is_refused(tmp_path):
    (tmp_path / "four_bar.toml").write_text(ROWS.format(rest="assembled_deg = { crank = 60 }"))
    with pytest.raises(
        UnsupportedModelError, match=r"loop pin does not close with crank 1\.047 rad, within 0\.5 rad or m"
    ):
        load_closed_robot(tmp_path / "four_bar.toml")
