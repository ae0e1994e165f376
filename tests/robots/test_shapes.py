"""Shapes from tables, URDF and MJCF, and what is said where there are none."""

import mujoco
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import link_poses
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.robots.catalog import load_robot
from catenary.robots.geometry import (
    Ball,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    MeshFile,
    TriangleMesh,
    capsule_between,
    check_form,
)
from catenary.robots.shapes import _DENSITY_KG_M3, capsules_along_links, load_geometry
from colliding_arm import write_arm


@pytest.fixture
def arm(tmp_path):
    return write_arm(tmp_path)


def test_a_urdf_gives_its_collision_shapes(arm):
    found = load_geometry(arm, load_robot(arm))
    kinds = [type(shape.form) for shape in found.shapes]
    assert kinds == [Box, Cylinder, MeshFile, Ball, Box]
    assert found.shapes[2].form.path == arm.parent / "meshes" / "elbow.stl"
    assert [shape.link for shape in found.shapes] == [-1, 0, 1, 2, 3]
    assert not found.assumed


def test_what_a_urdf_looks_like_is_taken_where_it_has_no_collision_shapes(arm):
    arm.write_text(arm.read_text().replace("collision>", "visual>"))
    found = load_geometry(arm, load_robot(arm))
    assert len(found.shapes) == 5
    assert "has no collision shapes; visual shapes are used" in found.notes[0]


def test_links_without_a_shape_are_named(arm):
    text = arm.read_text()
    start = text.index('<link name="fore"><collision>') + len('<link name="fore">')
    arm.write_text(text[:start] + text[text.index("</collision>", start) + len("</collision>") :])
    found = load_geometry(arm, load_robot(arm))
    assert "links without a shape, whose collisions are unchecked: fore" in found.notes[0]


def test_a_urdf_without_any_shape_gets_capsules(arm):
    text = arm.read_text()
    while "<collision>" in text:
        text = text[: text.index("<collision>")] + text[text.index("</collision>") + len("</collision>") :]
    arm.write_text(text)
    found = load_geometry(arm, load_robot(arm))
    assert found.assumed
    assert {type(shape.form) for shape in found.shapes} == {Capsule}


def test_a_mesh_is_found_in_a_folder_that_is_given_and_in_roses(arm, tmp_path_factory, monkeypatch):
    away = tmp_path_factory.mktemp("away") / "meshes"
    (arm.parent / "meshes").rename(away)
    model = load_robot(arm)
    with pytest.raises(
        FileFormatError, match=r'"elbow": <collision> 1: <mesh>: no mesh package://meshes/elbow.stl; .*--package-dir'
    ):
        load_geometry(arm, model)
    for packages in ([away.parent], [away]):
        assert load_geometry(arm, model, packages=packages).shapes[2].form.path == away / "elbow.stl"
    text = arm.read_text()
    assert load_geometry(text, model, packages=[away.parent]).shapes[2].form.path == away / "elbow.stl"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{away.parent}")
    assert load_geometry(arm, model).shapes[2].form.path == away / "elbow.stl"


@pytest.mark.parametrize(
    "name", [r"meshes\elbow.stl", r"package://meshes\elbow.stl", "file://{folder}/meshes/elbow.stl"]
)
def test_a_mesh_may_be_named_as_windows_does_or_by_an_address(arm, name):
    arm.write_text(arm.read_text().replace("package://meshes/elbow.stl", name.format(folder=arm.parent)))
    assert load_geometry(arm, load_robot(arm)).shapes[2].form.path.samefile(arm.parent / "meshes" / "elbow.stl")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<sphere radius="0.08"/>', "", "<geometry> holds nothing: expected one of box"),
        ('<sphere radius="0.08"/>', '<cone radius="1"/>', "<geometry> holds <cone>"),
        ('<sphere radius="0.08"/>', '<sphere radius="-1"/>', "size -1, expected above zero"),
        ('<sphere radius="0.08"/>', '<sphere radius="big"/>', 'radius="big", expected a number'),
        ("package://meshes/elbow.stl", "http://meshes/elbow.stl", "expected package://, file:// or a path"),
        ("package://meshes/elbow.stl", "elbow.stl", "no mesh elbow.stl"),
        ('filename="package://meshes/elbow.stl"', "", "no filename"),
    ],
)
def test_shapes_that_cannot_be_are_refused_by_their_link(arm, old, new, said):
    text = arm.read_text()
    assert old in text
    arm.write_text(text.replace(old, new))
    with pytest.raises(FileFormatError) as caught:
        load_geometry(arm, load_robot(arm))
    assert said in str(caught.value)


MJCF = """<mujoco><asset><mesh name="wedge" vertex="0 0 0  0.2 0 0  0 0.3 0  0 0 0.4"/></asset><worldbody>
<geom type="plane" size="1 1 1" pos="0 0 -0.1"/>
<body name="upper" pos="0 0 0.3"><joint name="a" axis="0 1 0" range="-2 2" limited="true"/>
<geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.05"/><geom type="sphere" size="0.3" contype="0" conaffinity="0"/>
<body name="fore" pos="0 0 0.4"><joint name="b" axis="1 0 0" pos="0 0 0.1" range="-2 2" limited="true"/>
<geom type="box" size="0.1 0.2 0.3" euler="10 20 30"/><geom type="mesh" mesh="wedge" pos="0.1 0 0"/>
</body></body></worldbody></mujoco>"""


def test_an_mjcf_gives_the_geoms_that_collide_where_mujoco_has_them(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(MJCF)
    model = load_robot(path)
    found = load_geometry(path, model)
    assert [type(shape.form) for shape in found.shapes] == [HalfSpace, Capsule, Box, TriangleMesh]
    assert found.shapes[2].form == Box(0.2, 0.4, 0.6)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    q = np.array([0.7, -0.4])
    data.qpos[:] = q
    mujoco.mj_kinematics(theirs, data)
    rotations, positions = link_poses(model, q)
    colliding = [g for g in range(theirs.ngeom) if theirs.geom_contype[g]]
    for shape, geom in zip(found.shapes, colliding, strict=True):
        R, p = (np.eye(3), np.zeros(3)) if shape.link < 0 else (rotations[shape.link], positions[shape.link])
        assert_allclose(R @ shape.pose.position + p, data.geom_xpos[geom], atol=1e-12)
        assert_allclose(R @ shape.pose.rotation, data.geom_xmat[geom].reshape(3, 3), atol=1e-12)


@pytest.mark.parametrize("name", ["raven2", "raven2_right", "raven2_full", "raven2_full_right"])
def test_the_ravens_arcs_run_from_axis_to_axis_about_the_remote_centre(name):
    model = load_robot(name)
    found = load_geometry(name, model)
    assert found.assumed
    assert "assumed" in found.origin
    q = 0.5 * (model.lower + model.upper)
    rotations, positions = link_poses(model, q)
    remote = positions[0]
    ends = {}
    for shape in found.shapes:
        if shape.link in (0, 1):
            half = 0.5 * shape.form.length * shape.pose.rotation[:, 2]
            ends.setdefault(shape.link, []).extend(
                rotations[shape.link] @ (shape.pose.position + sign * half) + positions[shape.link] for sign in (-1, 1)
            )
    axes = [rotations[k] @ model.tree.axis[k] for k in range(3)]
    for link, pair in ((0, (0, 1)), (1, (1, 2))):
        directions = [(end - remote) / np.linalg.norm(end - remote) for end in ends[link]]
        for axis in pair:
            assert max(abs(d @ axes[axis]) for d in directions) > 0.9999
    right = {"raven2": "raven2_right", "raven2_full": "raven2_full_right"}.get(name)
    if right is not None:  # the arms mirror in y
        other = load_geometry(right, load_robot(right))
        assert [s.form for s in other.shapes] == [s.form for s in found.shapes]
        there = link_poses(load_robot(right), q)[0]
        for a, b in zip(found.shapes, other.shapes, strict=True):
            if a.link in (0, 1, 2):
                one = rotations[a.link] @ a.pose.position
                assert_allclose(one * [1, -1, 1], there[b.link] @ b.pose.position, atol=2e-4)


def test_a_table_may_state_capsules(tmp_path):
    text = """name = "rod"
convention = "modified"
sources = ["test"]
capsules_from = "measured"
[[link]]
name = "rod"
joint = "revolute"
alpha_deg = 0
a_m = 0
d_m = 0
theta_deg = 0
limits_deg = [-90, 90]
mass_kg = 1
com_m = [0.2, 0, 0]
[[capsule]]
frame = "rod"
from_m = [0, 0, 0]
to_m = [0.4, 0, 0]
radius_m = 0.03
"""
    path = tmp_path / "rod.toml"
    path.write_text(text)
    found = load_geometry(path, load_robot(path))
    assert found.origin == "capsules of the table of rod, measured"
    assert found.shapes[0].form == Capsule(0.03, 0.4)
    path.write_text(text.replace('frame = "rod"', 'frame = "road"'))
    with pytest.raises(InputError, match='no frame "road"'):
        load_geometry(path, load_robot(path))
    path.write_text(text.replace("radius_m = 0.03", "radius_m = 0"))
    with pytest.raises(ConfigError, match="radius_m"):
        load_robot(path)


def test_a_radius_takes_the_place_of_what_a_robot_looks_like(arm):
    model = load_robot(arm)
    found = load_geometry(arm, model, link_radius=0.04)
    assert {shape.form.radius for shape in found.shapes} == {0.04}
    with pytest.raises(InputError, match="link radius: expected above 0"):
        load_geometry(arm, model, link_radius=0.0)


@pytest.mark.parametrize("name", ["panda", "ur10e", "dual_arm_19", "iiwa14"])
def test_capsules_hold_their_links_masses_as_water(name):
    model = load_robot(name)
    found = capsules_along_links(model)
    for link, mass in enumerate(model.tree.mass):
        own = [shape.form for shape in found.shapes if shape.link == link]
        if mass > 0.0:
            length, radius = sum(form.length for form in own), own[0].radius
            volume = np.pi * radius**2 * length + 4 / 3 * np.pi * radius**3
            assert_allclose(_DENSITY_KG_M3 * volume, mass, rtol=1e-6)


def test_capsules_reach_from_joint_to_joint():
    model = load_robot("ur10e")
    arm = [s for s in capsules_along_links(model, 0.05).shapes if s.name == "upper_arm_link"]
    ends = [s.pose.position + k * s.form.length / 2 * s.pose.rotation[:, 2] for s in arm for k in (-1, 1)]
    for place in (np.zeros(3), [-0.6127, 0, 0]):
        assert min(np.linalg.norm(end - place) for end in ends) < 1e-9


def test_a_centre_of_mass_beside_the_line_lies_in_the_capsules():
    model = load_robot("ur10e")  # the upper arm stands beside the line between its joints
    arm = [s for s in capsules_along_links(model).shapes if s.name == "upper_arm_link"]
    com = model.tree.com[1]
    apart = []
    for s in arm:
        along = s.pose.rotation[:, 2]
        share = np.clip((com - s.pose.position) @ along, -s.form.length / 2, s.form.length / 2)
        apart.append(np.linalg.norm(com - s.pose.position - share * along) - s.form.radius)
    assert min(apart) < 0.0


def test_without_masses_a_radius_must_be_given():
    model = load_robot("dvrk_psm_motors")
    assert capsules_along_links(model) is None
    found = capsules_along_links(model, 0.02)
    assert {shape.form.radius for shape in found.shapes} == {0.02}
    assert {shape.link for shape in found.shapes} >= set(range(len(model.link_names)))


@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
@example([0.0, 0.0, 0.0, 0.0, 0.0, 8.9e-161])  # whose square is hardly a number
@example([0.0, 0.0, 0.0, 0.0, 5e-324, 5e-324])
def test_a_capsule_between_two_points_ends_there(numbers):
    start, end = np.array(numbers[:3]), np.array(numbers[3:])
    pose, form = capsule_between(start, end, 0.1)
    half = 0.5 * form.length * pose.rotation[:, 2]
    assert_allclose(pose.position - half, start, atol=1e-9)
    assert_allclose(pose.position + half, end, atol=1e-9)
    assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "form",
    [Ball(0.0), Ball(np.nan), Box(1, -1, 1), Capsule(0.1, -0.1), Capsule(2e3, 1), TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))],
)  # fmt: skip
def test_forms_that_nothing_has_are_refused(form):
    with pytest.raises(InputError, match=r"^shape: "):
        check_form("shape", form)
