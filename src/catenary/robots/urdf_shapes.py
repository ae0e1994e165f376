"""The shapes of a URDF's links: <collision>, or <visual> where a file has no collision shapes at all."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.robots.description import naming_the_file
from catenary.robots.geometry import (
    Ball,
    Box,
    Capsule,
    Cylinder,
    Form,
    Geometry,
    MeshFile,
    Shape,
    links_without_shape,
    shape_on,
)
from catenary.robots.model import RobotModel
from catenary.robots.urdf import named_elements, number_of, numbers_of, origin_of, urdf_root

FORMS = ("box", "cylinder", "sphere", "capsule", "mesh")
MOST_SHAPES = 10_000


def urdf_shapes(
    content: str | bytes,
    where: str,
    model: RobotModel,
    path: Path | None,
    packages: Sequence[Path] = (),
    kind: Literal["collision", "visual"] = "collision",
) -> Geometry | None:
    """Return the shapes of a URDF; None where it has none.

    Args:
        content: The URDF.
        where: What it is, for messages.
        model: The robot that was read from it.
        path: Where it lies, None for a text; meshes are looked for beside it.
        packages: Folders in which ROS's packages lie, for meshes named `package://PACKAGE/FILE`.
        kind: Which shapes; the others where the file has none of these.

    Raises:
        FileFormatError: A shape that is damaged or unknown, or a mesh that is not there.
    """
    robot = urdf_root(content, where)
    wanted = kind
    if robot.find(f"link/{kind}/geometry") is None:
        kind = "visual" if kind == "collision" else "collision"
    shapes: list[Shape] = []
    for name, link in named_elements(where, robot, "link"):
        for number, element in enumerate(link.findall(kind), start=1):
            what = f'{where}: link "{name}": <{kind}> {number}'
            if name not in model.frames or element.find("geometry") is None:
                continue
            form = _form(what, element, _Meshes(path, packages))
            with naming_the_file(where):
                shapes.append(shape_on(what, model, name, name, origin_of(what, element), form))
    if len(shapes) > MOST_SHAPES:
        raise FileFormatError(f"{where}: {len(shapes)} shapes, expected at most {MOST_SHAPES}")
    if not shapes:
        return None
    looks_taken = wanted == "collision" and kind == "visual"
    notes = [f"{where}: has no collision shapes; what links look like is taken"] if looks_taken else []
    if bare := links_without_shape(model, shapes):
        notes.append(f"{where}: links without a shape, whose collisions are unchecked: {', '.join(bare)}")
    return Geometry(model.name, tuple(shapes), f"the {kind} shapes of {where}", notes=tuple(notes))


def _form(what: str, element: Element, meshes: "_Meshes") -> Form:
    geometry = element.find("geometry")
    assert geometry is not None
    found = [each for each in geometry if each.tag in FORMS]
    if len(found) != 1:
        got = ", ".join(f"<{cut(each.tag)}>" for each in geometry) or "nothing"
        raise FileFormatError(f"{what}: <geometry> holds {got}: expected one of {', '.join(FORMS)}")
    form = found[0]
    what = f"{what}: <{form.tag}>"
    if form.tag == "box":
        x, y, z = numbers_of(what, form, "size", 3)
        return Box(float(x), float(y), float(z))
    if form.tag == "sphere":
        return Ball(number_of(what, form, "radius"))
    if form.tag == "mesh":
        x, y, z = numbers_of(what, form, "scale", 3) if "scale" in form.attrib else (1.0, 1.0, 1.0)
        return MeshFile(meshes.find(what, form.get("filename")), (float(x), float(y), float(z)))
    radius, length = number_of(what, form, "radius"), number_of(what, form, "length")
    return Cylinder(radius, length) if form.tag == "cylinder" else Capsule(radius, length)


class _Meshes:
    """Where the meshes of a URDF lie."""

    def __init__(self, path: Path | None, packages: Sequence[Path]) -> None:
        self._beside = None if path is None else path.absolute().parent
        # ROS's own variable: where its packages lie
        listed = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if p]
        self._packages = [*packages, *listed]

    def find(self, what: str, name: str | None) -> Path:
        """Return the file of a mesh.

        Raises:
            FileFormatError: It is not there; the message names the folders that were looked in.
        """
        if not name:
            raise FileFormatError(f"{what}: no filename")
        scheme, _, rest = name.partition("://")
        places: list[Path] = []
        if not rest:
            places = [Path(name)] if self._beside is None else [self._beside / name]
        elif scheme == "file":
            places = [Path(unquote(urlsplit(name).path))]
        elif scheme in ("package", "model"):
            # a package is a folder of its name: in the folders given, or above the file
            above = [] if self._beside is None else [self._beside, *self._beside.parents]
            places = [folder / rest for folder in [*self._packages, *above]]
            package, _, inside = rest.partition("/")
            places += [folder / inside for folder in self._packages if folder.name == package]
        else:
            raise FileFormatError(f"{what}: {cut(name)}: expected package://, file:// or a path")
        for place in places:
            if _is_file(place):
                return place
        hint = "; give the folder that the package lies in with --package-dir" if scheme == "package" else ""
        raise FileFormatError(f"{what}: no mesh {cut(name)}{hint}")


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
