"""Friction and rotors that a URDF states: <dynamics>, rotors of its transmissions, and of an SRDF beside it."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import Element

from catenary.documents import MOST_XML, read_bounded, xml_tree
from catenary.errors import FileFormatError
from catenary.robots.actuation import Actuation, StatedDrive, stated_actuation
from catenary.robots.assembly import file_source, left_out
from catenary.robots.mimic_joints import Mimic
from catenary.robots.urdf_elements import number_of

REDUCTION = ("mechanicalReduction", "gear_ratio")  # of ROS, of Drake
ROTOR = ("motorInertia", "rotor_inertia")


def srdf_rotors(path: Path | None, robot: str) -> tuple[dict[str, float], list[str]]:
    """Return the reflected inertia of rotors by joint [kg m2] that an SRDF beside a URDF states, and its source.

    It is looked for beside the URDF and in the folder `srdf` beside its own, by the URDF's name and by the robot's.
    """
    folders = [] if path is None else [path.parent, path.parent.parent / "srdf"]
    names = [] if path is None else [f"{name}.srdf" for name in (path.stem, robot) if "/" not in name]
    for place in (folder / name for folder in folders for name in names):
        if place.is_file():
            rotors, content = dict[str, float](), read_bounded(place, MOST_XML)
            for joint in xml_tree(content, str(place)).iterfind("rotor_params/joint"):
                what = f'{place}: rotor of joint "{joint.get("name")}"'
                gear, inertia = (number_of(what, joint, key) for key in ("gear_ratio", "mass"))  # "mass" in kg m2
                rotors[str(joint.get("name"))] = gear**2 * inertia
            if any(rotors.values()):
                return rotors, [file_source(place, content)]
    return {}, []


def stated_drives(
    where: str, robot: Element, leaders: Mapping[str, Mimic], beside: Mapping[str, float]
) -> tuple[Actuation | None, list[str]]:
    """Return what a URDF states of its joints' drives, and notes on transmissions that it leaves out.

    A rotor of inertia J that turns N times as fast as its joint has the reflected inertia N^2 J. It is known where a
    transmission of one joint states both (`mechanicalReduction` and `motorInertia`, or Drake's `gear_ratio` and
    `rotor_inertia`), or where an SRDF does (`beside`). `leaders` has each moving joint in terms of a coordinate.
    """
    rotors, without = dict(beside), list[str]()
    for transmission in robot.findall("transmission"):
        joints = [str(joint.get("name")) for joint in transmission.findall("joint")]
        what = f'{where}: transmission "{transmission.get("name")}"'
        gear, rotor = (_first(what, transmission, tags) for tags in (REDUCTION, ROTOR))
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
        for said, value in (("friction", friction), ("damping", damping), ("rotor's inertia", rotor)):
            if value < 0.0:
                raise FileFormatError(f"{what}: {said} {value:g}, expected zero or more")
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
                return float(text)
            raise FileFormatError(f"{what}: <{element.tag}> is {text!r}, expected a number")
    return None
