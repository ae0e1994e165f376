"""Shapes of robots' links: out of URDF, MJCF or a table, or capsules along the links where nothing tells them."""

import os
from collections.abc import Sequence
from contextlib import suppress
from importlib.resources import as_file
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit
from xml.etree.ElementTree import Element

import numpy as np

from catenary.arrays import Floats
from catenary.bounded_parsers import MAX_XML_BYTES, cut, read_bounded, xml_root_tag
from catenary.config import load_toml
from catenary.errors import FileFormatError, InputError
from catenary.robots import geometry
from catenary.robots.assembly import left_out, naming_the_file
from catenary.robots.catalog import catalogue_file, robot_names
from catenary.robots.dh_table import XML_ENDINGS, RobotTable, described_table, description_of
from catenary.robots.mjcf import CompiledMjcf, compile_mjcf
from catenary.robots.model import RobotModel
from catenary.robots.urdf import named_elements, number_of, numbers_of, origin_of, urdf_root
from catenary.spatial import Pose, rotation_from_quaternion

Kind = Literal["collision", "visual"]
_URDF_FORMS = ("box", "cylinder", "sphere", "capsule", "mesh")
_DENSITY_KG_M3 = 1000.0  # [kg/m3] of water
_NO_LENGTH_M = 1e-6  # [m] a segment of less is a point
Segment = tuple[Floats, Floats]


def load_geometry(
    source: str | Path, model: RobotModel, *, packages: Sequence[Path] = (), link_radius: float | None = None
) -> geometry.Geometry | None:
    """Return the shapes of a robot's links; None if nothing tells them.

    They come from the robot's description: collision shapes of a URDF, geoms of an MJCF, `[[capsule]]` of a table.
    Where it has none they are capsules along the links (`capsules_along_links`).

    Args:
        source: What the robot was loaded from: a name in the catalogue, a file, or the text of a URDF.
        model: The robot.
        packages: Folders in which ROS's packages lie, for meshes named `package://PACKAGE/FILE`.
        link_radius: Of capsules along the links [m], in place of what the description has.
    """
    if link_radius is not None:
        if not 0.0 < link_radius < 1.0:
            raise InputError(f"link radius: expected above 0 and below 1 m, got {link_radius:g}")
        return capsules_along_links(model, link_radius)
    return described_geometry(source, model, packages=packages) or capsules_along_links(model)


def described_geometry(
    source: str | Path, model: RobotModel, *, packages: Sequence[Path] = (), kind: Kind = "collision"
) -> geometry.Geometry | None:
    """Return the shapes that a robot's description states; None if it states none.

    Args:
        source: As of `load_geometry`: name in the catalogue, file, or URDF text.
        model: The robot.
        packages: Folders of ROS packages in which meshes are looked up.
        kind: Which of a URDF's shapes: "collision" or "visual"; the others where there are none.
    """
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return urdf_shapes(source, "robot description", model, None, packages, kind)
    if str(source) in robot_names():
        with as_file(catalogue_file(str(source))) as table:
            return table_shapes(table, model)
    path = Path(source)
    if path.suffix.lower() == ".toml":
        if (described := described_table(path)) is None:
            return table_shapes(path, model)
        path = description_of(path, described.description)
    if path.suffix.lower() not in XML_ENDINGS:
        return None
    content = read_bounded(path, MAX_XML_BYTES)
    if xml_root_tag(content, str(path)) == "robot":
        return urdf_shapes(content, str(path), model, path, packages, kind)
    return mjcf_shapes(path, model)


def capsules_along_links(model: RobotModel, radius: float | None = None) -> geometry.Geometry | None:
    """Return capsules along the links; None where neither masses nor a radius say how thick they are.

    From a link's joint to those it carries, thick enough to hold the link's mass as a body of the density of water: an
    assumption, not a measurement. Where the centre of mass lies outside a capsule to the next joint, two capsules pass
    through it. `radius` is of all capsules [m]; by the links' masses when None.
    """
    known = [i for i, mass in enumerate(model.tree.mass) if mass > 0.0]
    if radius is None and not known:
        return None
    shapes: list[geometry.Shape] = []
    radii: list[float] = []
    for link, name in enumerate(model.link_names):
        mass = float(model.tree.mass[link])
        if radius is None and mass == 0.0:
            continue
        segments = _segments(model, link)
        thick = _thickness(mass, segments) if radius is None else radius
        segments = _through_com(segments, model.tree.com[link], thick) if mass > 0.0 else segments
        if radius is None:
            thick = _thickness(mass, segments)
        radii.append(thick)
        shapes += [geometry.Shape(name, link, *geometry.capsule_between(*segment, thick)) for segment in segments]
    for child in np.flatnonzero(model.tree.parent < 0):
        end = model.tree.origin[child]
        if np.linalg.norm(end) > _NO_LENGTH_M:
            shapes.append(geometry.Shape(model.base, -1, *geometry.capsule_between(np.zeros(3), end, radii[0])))
    thickness = f"{1000 * min(radii):.0f} to {1000 * max(radii):.0f} mm"
    by = "as given" if radius is not None else "as thick as their masses are in water"
    return geometry.Geometry(
        model.name, tuple(shapes), f"capsules along its links, {thickness} in radius, {by}", assumed=True
    )


def _segments(model: RobotModel, link: int) -> list[Segment]:
    """Return a link's extent in its own frame: from its joint to each one it carries, or to its last frame."""
    ends = [model.tree.origin[c] for c in np.flatnonzero(model.tree.parent == link)]
    if not ends:
        ends = [frame.pose.position for frame in model.frames.values() if frame.link == link]
        ends = sorted(ends, key=lambda end: float(np.linalg.norm(end)))[-1:]
    far = [end for end in ends if np.linalg.norm(end) > _NO_LENGTH_M]
    return [(np.zeros(3), end) for end in far] or [(np.zeros(3), np.zeros(3))]


def _through_com(segments: list[Segment], com: Floats, radius: float) -> list[Segment]:
    if min(geometry.distance_to_segment(com, *segment) for segment in segments) <= radius:
        return segments
    nearest = min(segments, key=lambda segment: geometry.distance_to_segment(com, *segment))
    others = [segment for segment in segments if segment is not nearest]
    halves = [(nearest[0], com), (com, nearest[1])]
    return [*others, *(half for half in halves if np.linalg.norm(half[1] - half[0]) > _NO_LENGTH_M)]


def _thickness(mass: float, segments: list[Segment]) -> float:
    """Return the radius r at which capsules hold a mass: m / density = pi r^2 length + 4/3 pi r^3."""
    length = sum(float(np.linalg.norm(end - start)) for start, end in segments)
    roots = np.roots([4.0 / 3.0 * np.pi, np.pi * length, 0.0, -mass / _DENSITY_KG_M3])
    return float(roots[np.isclose(roots.imag, 0.0) & (roots.real > 0.0)].real[0])


def table_shapes(path: Path, model: RobotModel) -> geometry.Geometry | None:
    """Return the capsules of a robot table; None if it has none."""
    table = load_toml(path, RobotTable)
    if not table.capsule:
        return None
    shapes = []
    for row in table.capsule:
        pose, capsule = geometry.capsule_between(np.array(row.from_m), np.array(row.to_m), row.radius_m)
        try:
            link = model.frame(row.frame).link
            name = model.base if link < 0 else model.link_names[link]
            shapes.append(geometry.shape_on(table.name, model, row.frame, name, pose, capsule))
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
    origin = f"capsules of the table of {table.name}, {table.capsules_from}"
    return geometry.Geometry(model.name, tuple(shapes), origin, assumed=True)


def urdf_shapes(
    content: str | bytes,
    where: str,
    model: RobotModel,
    path: Path | None,
    packages: Sequence[Path] = (),
    kind: Kind = "collision",
) -> geometry.Geometry | None:
    """Return the shapes of a URDF, whose meshes are looked for beside `path`; None if it has none."""
    robot = urdf_root(content, where)
    requested = kind
    if robot.find(f"link/{kind}/geometry") is None:
        kind = "visual" if kind == "collision" else "collision"
    shapes: list[geometry.Shape] = []
    for name, link in named_elements(where, robot, "link"):
        for number, element in enumerate(link.findall(kind), start=1):
            what = f'{where}: link "{name}": <{kind}> {number}'
            if name not in model.frames or element.find("geometry") is None:
                continue
            form = _urdf_form(what, element, path, packages)
            with naming_the_file(where):
                shapes.append(geometry.shape_on(what, model, name, name, origin_of(what, element), form))
    if not shapes:
        return None
    looks_taken = requested == "collision" and kind == "visual"
    notes = [f"{where}: has no collision shapes; visual shapes are used"] if looks_taken else []
    if bare := geometry.links_without_shape(model, shapes):
        notes.append(f"{where}: links without a shape, whose collisions are unchecked: {', '.join(bare)}")
    return geometry.Geometry(model.name, tuple(shapes), f"the {kind} shapes of {where}", notes=tuple(notes))


def _urdf_form(what: str, element: Element, path: Path | None, packages: Sequence[Path]) -> geometry.Form:
    stated = element.find("geometry")
    assert stated is not None
    forms = [element for element in stated if element.tag in _URDF_FORMS]
    if len(forms) != 1:
        got = ", ".join(f"<{cut(element.tag)}>" for element in stated) or "nothing"
        raise FileFormatError(f"{what}: <geometry> holds {got}: expected one of {', '.join(_URDF_FORMS)}")
    form = forms[0]
    what = f"{what}: <{form.tag}>"
    if form.tag == "box":
        x, y, z = numbers_of(what, form, "size", 3)
        return geometry.Box(float(x), float(y), float(z))
    if form.tag == "sphere":
        return geometry.Ball(number_of(what, form, "radius"))
    if form.tag == "mesh":
        x, y, z = numbers_of(what, form, "scale", 3) if "scale" in form.attrib else (1.0, 1.0, 1.0)
        mesh = _mesh(what, form.get("filename"), path, packages)
        return geometry.MeshFile(mesh, (float(x), float(y), float(z)))
    radius, length = number_of(what, form, "radius"), number_of(what, form, "length")
    return geometry.Cylinder(radius, length) if form.tag == "cylinder" else geometry.Capsule(radius, length)


def _mesh(what: str, name: str | None, path: Path | None, packages: Sequence[Path]) -> Path:
    """Return the file of a mesh that a URDF names, beside the URDF or in a ROS package."""
    if not name:
        raise FileFormatError(f"{what}: no filename")
    parent = None if path is None else path.absolute().parent
    # ROS's own variable: where its packages lie
    listed = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    folders = [*packages, *listed]
    scheme, _, tail = name.replace("\\", "/").partition("://")
    if not tail:
        places = [(parent or Path()) / written for written in (name, scheme)]  # the second with / for \ of Windows
    elif scheme == "file":
        from urllib.request import url2pathname  # brings http

        places = [Path(url2pathname(urlsplit(name).path))]
    elif scheme in ("package", "model"):
        # a package is a folder of its name: in the folders given, or above the file
        above = [] if parent is None else [parent, *parent.parents]
        places = [folder / tail for folder in [*folders, *above]]
        package, _, inside = tail.partition("/")
        places += [folder / inside for folder in folders if folder.name == package]
    else:
        raise FileFormatError(f"{what}: {cut(name)}: expected package://, file:// or a path")
    for place in places:
        with suppress(OSError, ValueError):  # a name that no file can have
            if place.is_file():
                return place
    hint = "; give the package's folder with --package-dir" if scheme == "package" else ""
    raise FileFormatError(f"{what}: no mesh {cut(name)}{hint}")


def mjcf_shapes(path: Path, model: RobotModel) -> geometry.Geometry | None:
    """Return the shapes of an MJCF file; None if it has none."""
    c = compile_mjcf(path)
    m = c.model
    colliding = [g for g in range(m.ngeom) if m.geom_contype[g] or m.geom_conaffinity[g]]
    taken = colliding or list(range(m.ngeom))
    shapes: list[geometry.Shape] = []
    unknown = []
    for geom in taken:
        form = _mjcf_form(c, geom)
        body = int(m.geom_bodyid[geom])
        own = model.base if body == 0 else c.name("body", body)
        if form is None:
            unknown.append(own)
            continue
        pose = Pose(rotation_from_quaternion(m.geom_quat[geom]), np.array(m.geom_pos[geom]))
        with naming_the_file(str(path)):
            shapes.append(geometry.shape_on(f'{path}: geom {geom} of "{own}"', model, own, own, pose, form))
    if not shapes:
        return None
    notes = left_out("shapes that are neither simple nor meshes", unknown)
    if bare := geometry.links_without_shape(model, shapes):
        notes.append(f"{path}: bodies without a shape, whose collisions are unchecked: {', '.join(bare)}")
    kind = "colliding geoms" if colliding else "geoms"
    return geometry.Geometry(model.name, tuple(shapes), f"the {kind} of {path}", notes=tuple(notes))


def _mjcf_form(c: CompiledMjcf, geom: int) -> geometry.Form | None:
    """Return a geom's form; None for height fields and the like. MuJoCo's sizes are half lengths."""
    m, kinds = c.model, c.mujoco.mjtGeom
    kind = c.mujoco.mjtGeom(m.geom_type[geom])
    x, y, z = (float(v) for v in m.geom_size[geom])
    forms: dict[object, geometry.Form] = {
        kinds.mjGEOM_PLANE: geometry.HalfSpace(),
        kinds.mjGEOM_SPHERE: geometry.Ball(x),
        kinds.mjGEOM_CAPSULE: geometry.Capsule(x, 2.0 * y),
        kinds.mjGEOM_CYLINDER: geometry.Cylinder(x, 2.0 * y),
        kinds.mjGEOM_BOX: geometry.Box(2.0 * x, 2.0 * y, 2.0 * z),
        kinds.mjGEOM_ELLIPSOID: geometry.Ellipsoid(x, y, z),
    }
    if kind != kinds.mjGEOM_MESH:
        return forms.get(kind)
    mesh = int(m.geom_dataid[geom])
    v, f = int(m.mesh_vertadr[mesh]), int(m.mesh_faceadr[mesh])
    vertices = np.array(m.mesh_vert[v : v + int(m.mesh_vertnum[mesh])], dtype=float)
    return geometry.TriangleMesh(vertices, np.array(m.mesh_face[f : f + int(m.mesh_facenum[mesh])], dtype=np.int64))
