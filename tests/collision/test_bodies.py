import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision import scene
from catenary.collision.scene import body_of, box_at, floor_at, mesh_at
from catenary.errors import FileFormatError, InputError, MissingPackageError
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Shape, TriangleMesh
from catenary.spatial import Pose, rotation_from_vector

POSE = Pose(rotation_from_vector([0.3, -0.5, 0.2]), np.array([0.1, 0.2, -0.3]))
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
TETRAHEDRON = TriangleMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def body(form):
    return body_of(Shape("link", 0, POSE, form))


def test_balls_about_forms_hold_them():
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(500, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    angle = rng.uniform(0, 6.28, 500)
    rim = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), rng.choice([-0.5, 0.5], 500)])
    for form, points in (
        (Ball(0.4), 0.4 * sphere),
        (Capsule(0.2, 1.0), [[0, 0, 0.7], [0, 0, -0.7], [0.2, 0, 0.5]]),
        (Box(0.2, 0.6, 0.3), CORNERS * [0.2, 0.6, 0.3]),
        (Cylinder(0.2, 1.0), rim),
        (Ellipsoid(0.2, 0.6, 0.3), sphere * [0.2, 0.6, 0.3]),
        (TETRAHEDRON, TETRAHEDRON.vertices),
    ):
        one, there = body(form), points @ POSE.rotation.T + POSE.position
        assert np.linalg.norm(there - one.centre, axis=1).max() < one.radius + 1e-6, form
    assert body(HalfSpace()).is_plane


def test_what_is_missing_is_said(monkeypatch):
    scene._coal.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "coal", None)
    with pytest.raises(MissingPackageError, match=r"pip install .*coal"):
        body(Box(1, 1, 1))


def test_obstacles_stand_where_they_were_put(tmp_path):
    assert floor_at(-0.2).pose.position[2] == -0.2
    box = box_at(3, [1, 2, 3, 0.1, 0.2, 0.3])
    assert box.name == "box 3"
    assert tuple(box.form) == (0.1, 0.2, 0.3)
    (tmp_path / "table.stl").write_text("solid")
    assert_array_equal(mesh_at(tmp_path / "table.stl", [1, 2, 3]).pose.position, [1, 2, 3])


def test_what_cannot_stand_anywhere_is_refused(tmp_path):
    with pytest.raises(InputError, match="floor: height nan"):
        floor_at(np.nan)
    with pytest.raises(InputError, match="box 1: expected six numbers"):
        box_at(1, [1, 2, 3])
    with pytest.raises(InputError, match="box 1: size 0, expected above zero"):
        box_at(1, [1, 2, 3, 1, 0, 1])
    with pytest.raises(FileFormatError, match="no such mesh"):
        mesh_at(tmp_path / "none.stl", [0, 0, 0])
