"""The shapes of an MJCF's bodies: the geoms that collide, or all where none does, as MuJoCo compiles them."""

from pathlib import Path

import numpy as np

from catenary.robots.description import left_out, naming_the_file, read_description
from catenary.robots.geometry import (
    Ball,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Form,
    Geometry,
    HalfSpace,
    Shape,
    TriangleMesh,
    links_without_shape,
    shape_on,
)
from catenary.robots.mjcf import CompiledMjcf, compile_mjcf
from catenary.robots.mjcf_bounds import included_files, refuse_too_much
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, rotation_from_quaternion


def mjcf_shapes(path: Path, model: RobotModel) -> Geometry | None:
    """Return the shapes of an MJCF file; None where it has none.

    Raises:
        FileFormatError: MuJoCo cannot read the file, or a size no robot has.
        MissingPackageError: MuJoCo is not installed.
    """
    content = read_description(path)
    refuse_too_much(path, content, included_files(path, content))
    c = compile_mjcf(path)
    m = c.model
    colliding = [g for g in range(m.ngeom) if m.geom_contype[g] or m.geom_conaffinity[g]]
    taken = colliding or list(range(m.ngeom))
    shapes: list[Shape] = []
    unknown = []
    for geom in taken:
        form = _form(c, geom)
        body = int(m.geom_bodyid[geom])
        own = model.base if body == 0 else c.name("body", body)
        if form is None:
            unknown.append(own)
            continue
        pose = Pose(rotation_from_quaternion(m.geom_quat[geom]), np.array(m.geom_pos[geom]))
        with naming_the_file(str(path)):
            shapes.append(shape_on(f'{path}: geom {geom} of "{own}"', model, own, own, pose, form))
    if not shapes:
        return None
    notes = left_out("shapes that are neither simple nor meshes", unknown)
    if bare := links_without_shape(model, shapes):
        notes.append(f"{path}: bodies without a shape, whose collisions are unchecked: {', '.join(bare)}")
    kind = "colliding geoms" if colliding else "geoms"
    return Geometry(model.name, tuple(shapes), f"the {kind} of {path}", notes=tuple(notes))


def _form(c: CompiledMjcf, geom: int) -> Form | None:
    """Return a geom's form; None for height fields and the like. MuJoCo's sizes are half lengths."""
    m, kinds = c.model, c.mujoco.mjtGeom
    kind = c.mujoco.mjtGeom(m.geom_type[geom])
    x, y, z = (float(v) for v in m.geom_size[geom])
    forms: dict[object, Form] = {
        kinds.mjGEOM_PLANE: HalfSpace(),
        kinds.mjGEOM_SPHERE: Ball(x),
        kinds.mjGEOM_CAPSULE: Capsule(x, 2.0 * y),
        kinds.mjGEOM_CYLINDER: Cylinder(x, 2.0 * y),
        kinds.mjGEOM_BOX: Box(2.0 * x, 2.0 * y, 2.0 * z),
        kinds.mjGEOM_ELLIPSOID: Ellipsoid(x, y, z),
    }
    if kind != kinds.mjGEOM_MESH:
        return forms.get(kind)
    mesh = int(m.geom_dataid[geom])
    v, f = int(m.mesh_vertadr[mesh]), int(m.mesh_faceadr[mesh])
    vertices = np.array(m.mesh_vert[v : v + int(m.mesh_vertnum[mesh])], dtype=float)
    return TriangleMesh(vertices, np.array(m.mesh_face[f : f + int(m.mesh_facenum[mesh])], dtype=np.int64))
