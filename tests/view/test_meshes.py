from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics, link_poses
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Ellipsoid, HalfSpace
from catenary.view.meshes import arc, arm_length, arm_shapes, bar, form_mesh, shapes_of

ARM = """<robot name="arm">
  <link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
  <link name="upper">
    <inertial><mass value="1"/><origin xyz="0 0 0.1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 0.2"/><geometry><mesh filename="upper.stl" scale="2 2 2"/></geometry></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>"""


@pytest.mark.alike
@pytest.mark.parametrize("name", robot_names())
def test_drawn_arm_hangs_together_from_base_to_tip(name: str) -> None:
    model = load_robot(name)
    shapes = arm_shapes(model)
    assert len(shapes.links) == len(model.link_names)
    q = np.clip(0.3 * np.ones(model.n), model.lower, model.upper)
    rotations, positions = link_poses(model, q)
    drawn = [mesh.vertices @ r.T + p for mesh, r, p in zip(shapes.links, rotations, positions, strict=True)]
    tip = forward_kinematics(model, q).position
    reach = 0.06 * shapes.length
    assert min(np.linalg.norm(v - tip, axis=1).min() for v in drawn) < reach
    link = model.frame().link
    while (parent := int(model.tree.parent[link])) >= 0:  # every link touches the one that carries it
        apart = np.linalg.norm(drawn[link][:, None] - drawn[parent][None], axis=2).min()
        assert apart < reach, model.link_names[link]
        link = parent


def test_spherical_linkage_is_drawn_about_the_point_in_which_its_axes_meet() -> None:
    model = load_robot("raven2")
    shapes = arm_shapes(model)
    # the links of the spherical mechanism stay away from the port; the tool alone goes through it
    assert np.linalg.norm(shapes.links[0].vertices, axis=1).min() > 0.15
    assert np.linalg.norm(shapes.links[1].vertices, axis=1).min() > 0.15
    assert shapes.base is not None


def test_arm_length_of_a_planar_arm_is_the_sum_of_its_links() -> None:
    model = load_robot("planar_3r")
    straight = forward_kinematics(model, np.zeros(model.n)).position
    assert arm_length(model) == pytest.approx(np.linalg.norm(straight))


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3)]))
def test_bar_is_a_capsule_from_point_to_point_seen_from_outside(axis: np.ndarray) -> None:
    mesh = bar(axis, 3.0 * axis, 0.5)
    whole = np.pi * 0.5**2 * 2.0 + 4.0 / 3.0 * np.pi * 0.5**3
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(whole, rel=0.08)  # 16 sides; positive: faces look outwards
    assert (mesh.vertices @ axis).max() == pytest.approx(3.5)
    assert (mesh.vertices @ axis).min() == pytest.approx(0.5)


def test_arc_is_bent_about_the_origin_from_one_direction_to_another() -> None:
    a, b = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    mesh = arc(a, b, 1.0, 0.1)
    away = np.hypot(mesh.vertices[:, 0], np.linalg.norm(mesh.vertices[:, 1:], axis=1) - 1.0)
    assert_allclose(away, 0.1)
    assert min(np.linalg.norm(mesh.vertices - end, axis=1).min() for end in (a, b)) == pytest.approx(0.1)
    outwards = mesh.triangles_center / np.linalg.norm(mesh.triangles_center, axis=1, keepdims=True)
    far = np.linalg.norm(mesh.triangles_center, axis=1) > 1.05
    assert (np.einsum("ij,ij->i", mesh.face_normals, outwards)[far] > 0.0).all()


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    trimesh.creation.box(extents=(0.1, 0.1, 0.2)).export(tmp_path / "upper.stl")
    (tmp_path / "arm.urdf").write_text(ARM)
    return tmp_path / "arm.urdf"


def test_links_look_as_their_meshes_do_where_the_file_puts_them(arm: Path) -> None:
    shapes, why = shapes_of(str(arm), load_robot(arm))
    assert why is None
    (upper,) = shapes.links
    # the mesh of 0.1 x 0.1 x 0.2, twice as large, 0.2 m up
    assert_allclose(upper.vertices.min(axis=0), [-0.1, -0.1, 0.0], atol=1e-7)  # STL has single precision
    assert_allclose(upper.vertices.max(axis=0), [0.1, 0.1, 0.4], atol=1e-7)  # STL has single precision
    assert shapes.base is not None
    assert_allclose(np.ptp(shapes.base.vertices, axis=0), [0.2, 0.2, 0.1])


def test_arm_whose_mesh_is_not_there_is_drawn_as_tubes_and_says_why(arm: Path) -> None:
    arm.with_name("upper.stl").unlink()
    shapes, why = shapes_of(str(arm), load_robot(arm))
    assert why is not None
    assert "no mesh upper.stl" in why
    assert len(shapes.links) == 1


@pytest.mark.parametrize("damage", [b"", b"solid nothing", bytes(84), b"\xff" * 200])
def test_mesh_that_is_damaged_is_told_and_never_stops_the_view(arm: Path, damage: bytes) -> None:
    arm.with_name("upper.stl").write_bytes(damage)
    _, why = shapes_of(str(arm), load_robot(arm))
    assert why is not None
    assert "upper.stl" in why


def test_robots_of_the_catalogue_are_drawn_from_their_kinematics() -> None:
    model = load_robot("raven2")
    shapes, why = shapes_of("raven2", model)
    assert why is None
    assert_allclose(shapes.links[0].vertices, arm_shapes(model).links[0].vertices)


@pytest.mark.parametrize(
    ("form", "volume"),
    [
        (Box(0.1, 0.2, 0.3), 0.006),
        (Ball(0.2), 4.0 / 3.0 * np.pi * 0.008),
        (Ellipsoid(0.1, 0.2, 0.3), 4.0 / 3.0 * np.pi * 0.006),
        (Cylinder(0.1, 0.5), np.pi * 0.01 * 0.5),
        (Capsule(0.1, 0.5), np.pi * 0.01 * 0.5 + 4.0 / 3.0 * np.pi * 0.001),
    ],
)
def test_forms_have_the_volume_of_their_formulas(form, volume: float) -> None:
    mesh = form_mesh(form)
    assert mesh is not None
    assert mesh.volume == pytest.approx(volume, rel=0.1)  # of few faces


def test_floor_is_no_link() -> None:
    assert form_mesh(HalfSpace()) is None
