"""Robots from URDF files (http://wiki.ros.org/urdf/XML), and, only when asked, from xacro, which makes them.

Links, one-coordinate joints, mimic joints; friction in <dynamics>, rotors of transmissions and of an SRDF beside it.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from catenary.arrays import Floats
from catenary.bounded_parsers import MAX_XML_BYTES, cut, plain_number, read_bounded, xml_tree
from catenary.errors import FileFormatError, MissingPackageError, UnsupportedModelError
from catenary.robots.actuation import Actuation, StatedDrive, stated_actuation
from catenary.robots.assembly import (
    Coordinate,
    JointKind,
    Link,
    Mimic,
    assemble,
    depth_first,
    file_source,
    left_out,
    naming_the_file,
    resolve_mimics,
)
from catenary.robots.link_inertia import LinkInertia, symmetric
from catenary.robots.model import Massless, RobotModel
from catenary.spatial import Pose, identity_pose, rotation_from_quaternion, rotation_from_rpy

XACRO_HINT = (
    "is a xacro file: expanding it runs the Python in it, which nothing here does unasked. Expand one that you trust: "
    "xacro robot.urdf.xacro > robot.urdf, --xacro where a command has it, or load_xacro in Python"
)
# of these a model is made
_READ = {"parent", "child", "axis", "origin", "limit", "mimic", "inertial", "mass", "inertia"}
_REDUCTION = ("mechanicalReduction", "gear_ratio")  # of ROS, of Drake
_ROTOR = ("motorInertia", "rotor_inertia")
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_KINDS: dict[str, JointKind] = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
}  # fmt: skip


def load_urdf(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from a URDF file.

    The root link is the base; its own inertia plays no part. Coordinates are the joints that move and mimic no other,
    depth first from the base, siblings in the file's order; links and frames have the file's link names. A link
    without any inertia, shape or picture that carries a moving joint where it itself is moved is a step of a joint of
    several axes, and massless. A mass that the file says is zero is zero, and a doubt where the link is not declared
    massless.
    """
    content = read_bounded(path, MAX_XML_BYTES)
    return parse_urdf(content, str(path), massless=massless, sources=[file_source(path, content)], path=path)


def load_xacro(path: str | Path, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from a xacro file that you trust: xacro runs the Python in it, with its default arguments.

    No other reader of this package expands xacro.

    Args:
        path: The xacro file.
        massless: Links that may have no mass, as of `load_robot`.

    Raises:
        MissingPackageError: xacro is not installed.
        FileFormatError: xacro cannot expand the file, or what it makes is no URDF.
    """
    path = Path(path)
    try:
        import xacro
    except ImportError as error:
        raise MissingPackageError(
            f"{path}: is a xacro file, and xacro is not installed: pip install xacro, or source ROS, or expand it "
            "elsewhere (xacro robot.urdf.xacro > robot.urdf) and load the result"
        ) from error
    content = read_bounded(path, MAX_XML_BYTES)
    try:
        text: bytes = xacro.process_file(str(path)).toxml().encode()
    except Exception as error:  # any of an expression's in the file
        raise FileFormatError(f"{path}: xacro cannot expand it: {error}") from error
    if len(text) > MAX_XML_BYTES:
        raise FileFormatError(f"{path}: expands to {len(text)} bytes, expected at most {MAX_XML_BYTES}")
    return parse_urdf(text, str(path), massless=massless, sources=[file_source(path, content)], path=path)


def parse_urdf(
    text: str | bytes,
    where: str = "URDF",
    *,
    massless: Massless = (),
    sources: Sequence[str] = (),
    path: Path | None = None,
) -> RobotModel:
    """Return the robot of a URDF text, as `load_urdf` does; `where` opens errors, `path` has an SRDF beside it."""
    robot = urdf_root(text, where)
    links = dict(named_elements(where, robot, "link"))
    joints = [_joint(where, name, element, links) for name, element in named_elements(where, robot, "joint")]
    if not links:
        raise FileFormatError(f"{where}: no <link>, expected at least one")
    root = _only_root(where, links, joints)
    leaders = _leaders(where, joints)
    as_listed = [name for name, leader in leaders.items() if leader.leader == name]
    carried_by = {joint.link.name: joint for joint in joints}
    with naming_the_file(where):
        ordered = depth_first(f'robot "{robot.get("name")}"', [joint.link for joint in joints], root)
    joints = [carried_by[link.name] for link in ordered]
    leaders = {joint.name: leaders[joint.name] for joint in joints if joint.name in leaders}
    with np.errstate(all="ignore"):  # what is not finite is refused by name
        stepping = {j.link.parent for j in joints if j.link.joint != "fixed" and not j.link.pose.position.any()}
        tree_links = []
        for joint in joints:
            name, leader = joint.link.name, leaders.get(joint.name)
            inertia = _inertia(f'{where}: link "{name}"', links[name])
            bare = len(links[name]) == 0 and name in stepping
            link = replace(joint.link, inertia=inertia, massless=bare or (inertia is not None and inertia.mass == 0.0))
            if leader is not None:
                link = replace(link, variable={str(leader.leader): leader.multiplier}, offset=leader.offset)
            tree_links.append(link)
    rotors, srdf_sources = _srdf_rotors(path, str(robot.get("name")))
    actuation, rotorless = _stated_drives(where, robot, leaders, rotors)
    declared = set(links) if massless == "all" else set(massless)
    weightless = [
        link.name for link in tree_links if link.massless and link.joint != "fixed" and link.inertia is not None
    ]
    with naming_the_file(where):
        model = assemble(
            robot.get("name") or "unnamed",
            tree_links,
            [joint.coordinate for joint in joints if joint.name in as_listed],
            root=root,
            actuation=actuation,
            sources=[*sources, *srdf_sources],
            notes=[*_notes(robot, joints, leaders), *rotorless],
            doubts=[f'link "{name}": has no mass, as the file says' for name in weightless if name not in declared],
            file_order=as_listed,
        )
    return model.with_massless(massless)


class _Joint(NamedTuple):
    name: str
    link: Link  # that it carries, without what moves it and its inertia
    coordinate: Coordinate
    mimic: Mimic | None
    element: Element


def urdf_root(text: str | bytes, where: str) -> Element:
    """Return the <robot> of a URDF text."""
    root = xml_tree(text, where)
    if root.tag != "robot":
        raise FileFormatError(f"{where}: root element <{cut(root.tag)}>, expected <robot>")
    xacro = {"xacro"}
    for element in root.iter():
        xacro |= {key[6:] for key, value in element.items() if key.startswith("xmlns:") and "xacro" in value}
        values = element.attrib.values()
        if element.tag.partition(":")[0] in xacro or any("${" in v or "$(" in v for v in values):
            raise FileFormatError(f"{where}: {XACRO_HINT}")
    for part in (*root.iterfind("link//*"), *root.iterfind("joint//*")):
        prefix, _, name = part.tag.rpartition(":")
        if prefix and name in _READ:
            raise FileFormatError(f"{where}: <{cut(part.tag)}>, expected <{name}>: with a prefix it is not read")
    return root


def _joint(where: str, name: str, element: Element, links: Mapping[str, Element]) -> _Joint:
    what = f'{where}: joint "{name}"'
    kind = element.get("type")
    if kind in ("floating", "planar"):
        raise UnsupportedModelError(
            f'{what}: type "{kind}": a joint here has one coordinate; expected {", ".join(_KINDS)}'
        )
    if kind not in _KINDS:
        raise FileFormatError(f'{what}: type "{kind}", expected {", ".join(_KINDS)}')
    parent, child = (_link_name(what, element, tag, links) for tag in ("parent", "child"))
    axis = element.find("axis")
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else numbers_of(f"{what}: <axis>", axis, "xyz", 3)
    mimic = element.find("mimic")
    follows = None
    if mimic is not None and kind != "fixed":
        if not (leader := mimic.get("joint")):
            raise FileFormatError(f"{what}: <mimic> names no joint")
        keys = {"multiplier": 1.0, "offset": 0.0}
        follows = Mimic(leader, *(number_of(f"{what}: <mimic>", mimic, key, default=d) for key, d in keys.items()))
    link = Link(child, parent, _KINDS[kind], origin_of(what, element), direction)
    return _Joint(name, link, _coordinate(what, name, kind, element), follows, element)


def _link_name(what: str, joint: Element, tag: str, links: Mapping[str, Element]) -> str:
    element = joint.find(tag)
    name = None if element is None else element.get("link")
    if name is None:
        raise FileFormatError(f"{what}: no <{tag} link=...>")
    if name not in links:
        raise FileFormatError(f'{what}: <{tag}> is unknown link "{name}"; links: {", ".join(links)}')
    return name


def _coordinate(what: str, name: str, kind: str, joint: Element) -> Coordinate:
    """Return the joint's coordinate; a continuous joint has no position limits, whatever its <limit> says."""
    unit = "m" if kind == "prismatic" else "rad"
    limit = joint.find("limit")
    if kind == "fixed" or (limit is None and kind == "continuous"):
        return Coordinate(name, unit)
    if limit is None:
        raise FileFormatError(f"{what}: type {kind} without <limit>; expected lower, upper, effort, velocity")
    what = f"{what}: <limit>"
    velocity, effort = (number_of(what, limit, key) for key in ("velocity", "effort"))
    if kind == "continuous":
        return Coordinate(name, unit, velocity=velocity, effort=effort)
    lower, upper = (number_of(what, limit, key, default=0.0) for key in ("lower", "upper"))
    return Coordinate(name, unit, lower, upper, velocity, effort)


def _only_root(where: str, links: Mapping[str, Element], joints: Sequence[_Joint]) -> str:
    """Return the one link that is no joint's child; every other must have one parent."""
    carried_by: dict[str, str] = {}
    for joint in joints:
        child = joint.link.name
        if child in carried_by:
            raise UnsupportedModelError(
                f'{where}: link "{child}" has two parents, by joints "{carried_by[child]}" and '
                f'"{joint.name}": a loop cannot be represented by a tree'
            )
        carried_by[child] = joint.name
    roots = [name for name in links if name not in carried_by]
    if not roots:
        raise UnsupportedModelError(f"{where}: every link has a parent: a loop cannot be represented by a tree")
    if len(roots) > 1:
        raise FileFormatError(f"{where}: several root links: {', '.join(roots)}; expected one")
    return roots[0]


def _leaders(where: str, joints: Sequence[_Joint]) -> dict[str, Mimic]:
    """Return the moving joints in terms of those that are coordinates."""
    moving = [joint.name for joint in joints if joint.link.joint != "fixed"]
    mimics = {joint.name: joint.mimic for joint in joints if joint.mimic is not None}
    for name, mimic in mimics.items():
        if mimic.leader not in moving:
            raise FileFormatError(
                f'{where}: joint "{name}": <mimic> follows "{mimic.leader}", which is not a moving joint; '
                f"moving joints: {', '.join(sorted(moving))}"
            )
    with naming_the_file(where):
        return resolve_mimics(mimics, moving)


def _inertia(what: str, link: Element) -> LinkInertia | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    what = f"{what}: <inertial>"
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None:
        raise FileFormatError(f"{what}: no <mass>; expected one")
    entries = None
    if tensor is not None:
        entries = symmetric([number_of(f"{what}: <inertia>", tensor, key) for key in _TENSOR])
    about_com = LinkInertia(number_of(f"{what}: <mass>", mass, "value"), np.zeros(3), entries)
    return about_com.moved(origin_of(what, inertial))


def _notes(robot: Element, joints: Sequence[_Joint], leaders: Mapping[str, Mimic]) -> list[str]:
    """Return notes on what the file holds and the model leaves out, and which limits look like placeholders."""
    moving = [j for j in joints if j.name in leaders]
    free = [j for j in moving if leaders[j.name].leader == j.name]
    coordinates = {j.name: j.coordinate for j in free}
    notes = list[str]()
    for tag, what in (("calibration", "calibration positions"), ("safety_controller", "soft limits")):
        notes += left_out(what, [j.name for j in joints if j.element.find(tag) is not None])
    tighter = [j.name for j in moving if _is_tighter(j.coordinate, leaders[j.name], coordinates)]
    notes += left_out("position limits of mimic joints, tighter than their leader's", tighter)
    for key in ("velocity", "effort"):
        zero = [j.name for j in free if getattr(j.coordinate, key) == 0.0]
        notes += [f"{key} limit is 0 in the file ({', '.join(zero)})"] if zero else []
    locked = [j.name for j in free if j.coordinate.lower == j.coordinate.upper]
    notes += [f"lower and upper limit are equal in the file ({', '.join(locked)})"] if locked else []
    others = {e.tag: None for e in robot if e.tag not in ("link", "joint", "material", "transmission")}
    names = {name: None for e in robot.iter() for name in (e.tag, *e.keys()) if ":" in name}
    marked = [name for name in names if name not in others and not name.startswith("xmlns:")]
    spaces = {repr(e.attrib["xmlns"]): None for e in robot.iter() if "xmlns" in e.attrib}
    notes += left_out("elements", (f"<{tag}>" for tag in others))
    return notes + left_out("names with a prefix", marked) + left_out("namespaces", spaces)


def _is_tighter(own: Coordinate, mimic: Mimic, coordinates: Mapping[str, Coordinate]) -> bool:
    leader = coordinates[str(mimic.leader)]
    reached = sorted(mimic.multiplier * limit + mimic.offset for limit in (leader.lower, leader.upper))
    return reached[0] < own.lower - 1e-9 or reached[1] > own.upper + 1e-9


def _srdf_rotors(path: Path | None, robot: str) -> tuple[dict[str, float], list[str]]:
    """Return rotors' reflected inertia by joint [kg m2] that an SRDF beside a URDF states, and its source.

    It has the URDF's name, or the robot's, and may lie in the folder `srdf` beside the URDF's own.
    """
    folders = [] if path is None else [path.parent, path.parent.parent / "srdf"]
    names = [] if path is None else [f"{name}.srdf" for name in (path.stem, robot) if "/" not in name]
    for place in (folder / name for folder in folders for name in names):
        if place.is_file():
            rotors, content = dict[str, float](), read_bounded(place, MAX_XML_BYTES)
            for joint in xml_tree(content, str(place)).iterfind("rotor_params/joint"):
                what = f'{place}: rotor of joint "{joint.get("name")}"'
                gear, inertia = (number_of(what, joint, key) for key in ("gear_ratio", "mass"))  # "mass" in kg m2
                rotors[str(joint.get("name"))] = gear**2 * inertia
            if any(rotors.values()):
                return rotors, [file_source(place, content)]
    return {}, []


def _stated_drives(
    where: str, robot: Element, leaders: Mapping[str, Mimic], srdf_rotors: Mapping[str, float]
) -> tuple[Actuation | None, list[str]]:
    """Return the joint drives that a URDF states, and notes on transmissions that it leaves out.

    A rotor of inertia J that turns N times as fast as its joint has the reflected inertia N^2 J. It is known where a
    transmission of one joint states both (`mechanicalReduction` and `motorInertia`, or Drake's `gear_ratio` and
    `rotor_inertia`), or where an SRDF does (`srdf_rotors`). `leaders` has each moving joint in terms of a coordinate.
    """
    rotors, without = dict(srdf_rotors), list[str]()
    for transmission in robot.findall("transmission"):
        joints = [str(joint.get("name")) for joint in transmission.findall("joint")]
        what = f'{where}: transmission "{transmission.get("name")}"'
        gear, rotor = (_first(what, transmission, tags) for tags in (_REDUCTION, _ROTOR))
        if len(joints) == 1 and gear is not None and rotor is not None:
            rotors[joints[0]] = gear**2 * rotor
        else:
            without += joints
    drives = []
    for joint in robot.findall("joint"):
        name, dynamics = str(joint.get("name")), joint.find("dynamics")
        if name not in leaders:
            continue
        what = f'{where}: joint "{name}": <dynamics>'
        element = Element("dynamics") if dynamics is None else dynamics
        friction, damping = (number_of(what, element, key, default=0.0) for key in ("friction", "damping"))
        rotor = rotors.get(name, 0.0)
        for label, value in (("friction", friction), ("damping", damping), ("rotor's inertia", rotor)):
            if value < 0.0:
                raise FileFormatError(f"{what}: {label} {value:g}, expected zero or more")
        leader = leaders[name]
        drives.append(StatedDrive(str(leader.leader), leader.multiplier, friction, damping, rotor))
    coordinates = [name for name, leader in leaders.items() if leader.leader == name]
    notes = left_out("transmissions that state no rotor", dict.fromkeys(n for n in without if n not in rotors))
    return stated_actuation(coordinates, drives), notes


def _first(what: str, transmission: Element, tags: tuple[str, ...]) -> float | None:
    """Return the number of the first element of these names, in its text or as its `value`; prefixes do not matter."""
    for element in transmission.iter():
        if element.tag.rpartition(":")[2] in tags:
            text = element.get("value", element.text or "")
            with suppress(ValueError):
                return plain_number(text)
            raise FileFormatError(f"{what}: <{element.tag}> is {text!r}, expected a number")
    return None


def named_elements(where: str, robot: Element, tag: str) -> list[tuple[str, Element]]:
    """Return a robot's links or joints with their names, which must differ."""
    elements: dict[str, Element] = {}
    for number, element in enumerate(robot.findall(tag), start=1):
        name = element.get("name")
        if not name:
            raise FileFormatError(f"{where}: <{tag}> number {number}: no name")
        if name in elements:
            raise FileFormatError(f'{where}: two <{tag}> elements are named "{name}"')
        elements[name] = element
    return list(elements.items())


def origin_of(what: str, element: Element) -> Pose:
    """Return the pose that an element's <origin> states."""
    origin = element.find("origin")
    if origin is None:
        return identity_pose()
    what = f"{what}: <origin>"
    position = numbers_of(what, origin, "xyz", 3) if "xyz" in origin.attrib else np.zeros(3)
    if "quat_xyzw" in origin.attrib:  # URDF 1.2
        if "rpy" in origin.attrib:
            raise FileFormatError(f"{what}: has rpy and quat_xyzw, expected one of the two")
        quaternion = numbers_of(what, origin, "quat_xyzw", 4)
        if not np.abs(quaternion).max() > 1e-9:
            raise FileFormatError(f"{what}: quat_xyzw is zero, expected a rotation")
        return Pose(rotation_from_quaternion(np.roll(quaternion, 1)), position)
    rpy = numbers_of(what, origin, "rpy", 3) if "rpy" in origin.attrib else np.zeros(3)
    return Pose(rotation_from_rpy(rpy), position)


def number_of(what: str, element: Element, key: str, *, default: float | None = None) -> float:
    """Return a number that an attribute holds."""
    if key not in element.attrib and default is not None:
        return default
    return float(numbers_of(what, element, key, 1)[0])


def numbers_of(what: str, element: Element, key: str, count: int) -> Floats:
    """Return the finite numbers (count,) that an attribute holds."""
    expected = "a number" if count == 1 else f"{count} numbers"
    text = element.get(key)
    if text is None:
        raise FileFormatError(f"{what}: {key} is missing, expected {expected}")
    try:
        values = np.array([plain_number(word) for word in text.split()])
    except ValueError as error:
        raise FileFormatError(f'{what}: {key}="{cut(text)}", expected {expected}') from error
    if len(values) != count or not np.isfinite(values).all():
        raise FileFormatError(f'{what}: {key}="{cut(text)}", expected {expected}, finite')
    return values
