from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from catenary.robots.catalog import load_robot
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Ellipsoid, HalfSpace
from catenary.view.described import form_mesh, shapes_of
from catenary.view.shapes import arm_shapes

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
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(volume, rel=0.1)  # of few faces


def test_floor_is_no_link() -> None:
    assert form_mesh(HalfSpace()) is None
