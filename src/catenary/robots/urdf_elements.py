"""Elements of XML by name, and the numbers and poses that their attributes state."""

from xml.etree.ElementTree import Element

import numpy as np

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.spatial import Pose, identity_pose, rotation_from_quaternion, rotation_from_rpy


def named_elements(where: str, robot: Element, tag: str) -> list[tuple[str, Element]]:
    """Return a robot's links or joints with their names, which must differ."""
    found: dict[str, Element] = {}
    for number, element in enumerate(robot.findall(tag), start=1):
        name = element.get("name")
        if not name:
            raise FileFormatError(f"{where}: <{tag}> number {number}: no name")
        if name in found:
            raise FileFormatError(f'{where}: two <{tag}> elements are named "{name}"')
        found[name] = element
    return list(found.items())


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
        if not np.linalg.norm(quaternion) > 1e-9:
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
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise FileFormatError(f'{what}: {key}="{cut(text)}", expected {expected}') from error
    if len(values) != count or not np.isfinite(values).all():
        raise FileFormatError(f'{what}: {key}="{cut(text)}", expected {expected}, finite')
    return values
