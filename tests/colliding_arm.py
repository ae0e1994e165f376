"""Arms and motions for the tests of collisions."""

from itertools import pairwise

import numpy as np

from catenary.collision.scene import scene_of
from catenary.identification.excitation import series_at_rest
from catenary.robots.catalog import load_robot
from catenary.robots.geometry import Box, Geometry, shape_on
from catenary.robots.shapes import capsules_along_links
from catenary.spatial import identity_pose

ARM = load_robot("planar_3r")
PANDA = load_robot("panda")


def capsule_arm(model=PANDA, radius=0.03):
    return capsules_along_links(model, radius)


def box_arm(model=PANDA):
    """Boxes on the links: Coal is needed."""
    shapes = [shape_on("test", model, name, name, identity_pose(), Box(0.12, 0.1, 0.14)) for name in model.link_names]
    return Geometry(model.name, tuple(shapes), "boxes")


def apart(geometry, obstacles=(), model=PANDA):
    """Return the scene without pairs that are near in every pose."""
    q = np.random.default_rng(0).uniform(model.lower, model.upper, (40, model.n))
    return scene_of(model, geometry, obstacles).without_constant_contacts(q, 0.05)[0]


def motion(model, seed, amplitude=0.8, period=4.0, centre=None):
    series = series_at_rest(np.random.default_rng(seed).normal(size=(2, 3, model.n)), period)
    largest = np.abs(series.sample(series.grid())[0]).max(axis=0)
    size = amplitude / largest
    middle = 0.5 * (model.lower + model.upper) if centre is None else centre
    return type(series)(series.a * size, series.b * size, np.where(np.isfinite(middle), middle, 0.0), period)


def write_arm(folder):
    """Write a URDF of four links with all kinds of shapes, and its mesh, an L of two boxes; return its path."""
    write_mesh(folder / "elbow.stl")
    shapes = {
        "base_link": '<box size="0.2 0.2 0.1"/>',
        "upper": '<cylinder radius="0.05" length="0.4"/>',
        "elbow": '<mesh filename="package://meshes/elbow.stl" scale="0.5 0.5 0.5"/>',
        "fore": '<sphere radius="0.08"/>',
        "hand": '<box size="0.05 0.1 0.2"/>',
    }
    meshes = folder / "meshes"
    meshes.mkdir()
    (folder / "elbow.stl").rename(meshes / "elbow.stl")
    names = list(shapes)
    text = '<robot name="boxes">'
    for name, form in shapes.items():
        text += (
            f'<link name="{name}"><collision><origin xyz="0 0.02 0.1" rpy="0.2 0 0.1"/><geometry>{form}</geometry>'
            '</collision><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
            "</inertial></link>"
        )
    for k, (parent, child) in enumerate(pairwise(names)):
        axis = ("0 0 1", "0 1 0", "1 0 0", "0 1 0")[k]
        text += (
            f'<joint name="j{k}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="50" velocity="2"/></joint>'
        )
    path = folder / "boxes.urdf"
    path.write_text(text + "</robot>")
    return path


def write_mesh(path):
    """Write an L of two boxes as a binary STL."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = []
    for size, place in (((0.1, 0.1, 0.6), (0, 0, 0)), ((0.5, 0.1, 0.1), (0.05, 0, 0.5))):
        points = corners * size + place
        for a, b, c, d in faces:
            triangles += [points[[a, b, c]], points[[a, c, d]]]
    rows = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows["corners"] = triangles
    path.write_bytes(b" " * 80 + np.uint32(len(rows)).tobytes() + rows.tobytes())
