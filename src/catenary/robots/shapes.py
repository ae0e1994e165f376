"""The door to robots' shapes: read from where the robot comes from, or capsules along its links."""

from collections.abc import Sequence
from importlib.resources import as_file
from pathlib import Path

from catenary.documents import MOST_XML, read_bounded, xml_root_tag
from catenary.errors import InputError
from catenary.robots.catalog import catalogue_file, robot_names
from catenary.robots.geometry import Geometry
from catenary.robots.link_capsules import capsules_along_links
from catenary.robots.model import RobotModel

DESCRIPTIONS = (".urdf", ".xml", ".mjcf")  # endings of files that may state shapes, beside tables


def load_geometry(
    source: str | Path,
    model: RobotModel,
    *,
    packages: Sequence[Path] = (),
    link_radius: float | None = None,
) -> Geometry | None:
    """Return the shapes of a robot's links; None where nothing tells them.

    They come from the robot's description: collision shapes of a URDF, geoms of an MJCF, `[[capsule]]` of a table.
    Where it has none they are capsules along the links (`capsules_along_links`).

    Args:
        source: What the robot was loaded from: a name in the catalogue, a file, or the text of a URDF.
        model: The robot.
        packages: Folders in which ROS's packages lie, for meshes named `package://PACKAGE/FILE`.
        link_radius: Of capsules along the links [m], in place of what the description has.

    Raises:
        FileFormatError: A shape that is damaged, or a mesh that is not there.
        InputError: A radius that is not positive.
        MissingPackageError: MuJoCo, which reads MJCF, is not installed.
    """
    if link_radius is not None:
        if not 0.0 < link_radius < 1.0:
            raise InputError(f"link radius: expected above 0 and below 1 m, got {link_radius:g}")
        return capsules_along_links(model, link_radius)
    return _described(source, model, packages) or capsules_along_links(model)


def _described(source: str | Path, model: RobotModel, packages: Sequence[Path]) -> Geometry | None:
    from catenary.robots.table_shapes import table_shapes
    from catenary.robots.urdf_shapes import urdf_shapes

    if isinstance(source, str) and source.lstrip().startswith("<"):
        return urdf_shapes(source, "robot description", model, None, packages)
    if str(source) in robot_names():
        with as_file(catalogue_file(str(source))) as table:
            return table_shapes(table, model)
    path = Path(source)
    if path.suffix.lower() == ".toml":
        return table_shapes(path, model)
    if path.suffix.lower() not in DESCRIPTIONS:
        return None
    content = read_bounded(path, MOST_XML)
    if xml_root_tag(content, str(path)) == "robot":
        return urdf_shapes(content, str(path), model, path, packages)
    from catenary.robots.mjcf_shapes import mjcf_shapes

    return mjcf_shapes(path, model)
