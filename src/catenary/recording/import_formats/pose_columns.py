"""Poses of markers among the columns of a recording: of messages, of trackers' exports, of tables by their names."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.table_time import is_nameless

# of geometry_msgs/Pose and Transform, and of what trackers' exports are read as
PARTS = (("position", "orientation"), ("translation", "rotation"))
_POINTS = ("position", "translation", "point")
_TRACKERS = re.compile(r"marker|track|ndi|polaris|aurora|atracsys|optitrack|motive|vicon|mocap|rigid", re.IGNORECASE)
_ARM = re.compile(r"/(PSM|MTM|ECM|SUJ)\w*|/arm\d", re.IGNORECASE)  # of the dVRK and the RAVEN-II
_UNIT = r"(?:[ _]?[\[(]?(?:mm|cm|m|deg|rad)[\])]?)?\Z"
_STEM = r"(?P<stem>(?:.*[ ._/:])?)"
_TABLES = {  # what the names of a table's columns end in
    "position": re.compile(_STEM + r"(?:t|p|pos(?:ition)?[ ._]?)?(?P<axis>[xyz])" + _UNIT, re.IGNORECASE),
    "quaternion": re.compile(
        _STEM + r"(?:q|quat(?:ernion)?[ ._]|rot(?:ation)?[ ._])(?P<axis>[wxyz0])" + _UNIT, re.IGNORECASE
    ),
    "angles": re.compile(_STEM + r"(?P<axis>r[xyz]|roll|pitch|yaw)" + _UNIT, re.IGNORECASE),
}
_ORIENTATIONS = (  # how a mapping calls the angles of these names, and what may be wrong about it
    ("x y z w", "xyzw", ""),
    ("w x y z", "wxyz", ""),
    ("0 x y z", "wxyz", ""),
    ("rx ry rz", "vector", "axis times angle, as a UR says its tool, or angles about axes"),
    ("roll pitch yaw", "xyz", "turns about fixed axes, roll first, as ROS has them, or of another order"),
)


class PoseColumns(NamedTuple):
    """A pose, or a position alone, as a mapping names it."""

    references: tuple[str, ...]
    taken: tuple[str, ...]  # columns of the stream
    orientation: str = "xyzw"
    doubt: str = ""  # about the orientation

    @property
    def name(self) -> str:
        """The pose in a word."""
        return self.references[0] if len(self.references) == 1 else f"{self.references[0]} ... {self.references[-1]}"


def poses_of(streams: Sequence[Stream]) -> list[PoseColumns]:
    """Return the poses that move, but the robot's own of its tool and those that it was told."""
    found = []
    for stream in streams:
        place, _, verb = stream.name.removesuffix("/").rpartition("/")
        place = place.removesuffix("/local")
        own = any(other.name.startswith(f"{place}/") and re.search(r"_j[spvf]\Z", other.name) for other in streams)
        if verb.endswith("_cp") and (verb != "measured_cp" or own or _ARM.match(place)):
            continue
        poses = [*_by_parts(stream), *(_by_names(stream) if stream.type == "table" else ())]
        found += [one for one in poses if any(_moves(stream.columns[column]) for column in one.taken)]
    return found


def _moves(values: NDArray[Any]) -> bool:
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and finite.max() > finite.min()


def _by_parts(stream: Stream) -> list[PoseColumns]:
    """Return poses such as pose.position.x ... pose.orientation.w, and points alone."""
    front, found = "" if stream.type == "table" else f"{stream.name}.", dict[str, PoseColumns]()
    for position, orientation in PARTS:
        for name in stream.columns:
            base, dot, end = name.rpartition(f".{orientation}.")
            if dot and end == "w":
                taken = [f"{base}.{position}.{axis}" for axis in "xyz"] + [
                    f"{base}.{orientation}.{axis}" for axis in "xyzw"
                ]
                found[base] = PoseColumns((f"{front}{base}",), tuple(taken))
    for part in _POINTS:
        for name in stream.columns:
            base, dot, end = f".{name}".rpartition(f".{part}.")
            if dot and end == "x" and base[1:] not in found:
                whole = f"{base}.{part}".removeprefix(".")
                found[whole] = PoseColumns((f"{front}{whole}",), tuple(f"{whole}.{axis}" for axis in "xyz"))
    return [one for one in found.values() if set(one.taken) <= set(stream.columns)]


def _by_names(stream: Stream) -> list[PoseColumns]:
    """Return poses of a table such as tx ty tz qx qy qz qw; positions alone where the name is a tracker's."""
    names = tuple(stream.columns)
    if len(names) == 8 and is_nameless(stream):  # TUM's trajectories: time, position, quaternion
        quaternions = np.array([stream.columns[name] for name in names[4:]], dtype=np.float64)
        lengths = np.linalg.norm(quaternions, axis=0)
        if (np.abs(lengths[np.isfinite(lengths)] - 1.0) < 1e-2).all():
            return [PoseColumns(names[1:], names[1:])]
    parts: dict[str, dict[str, dict[str, str]]] = {}
    for name in names:
        for kind, pattern in _TABLES.items():
            match = pattern.match(name)
            if match:
                parts.setdefault(match["stem"], {}).setdefault(kind, {})[match["axis"].lower()] = name
                break
    found = []
    for stem, kinds in parts.items():
        position = kinds.get("position", {})
        if set(position) != set("xyz"):
            continue
        turns = {**kinds.get("quaternion", {}), **kinds.get("angles", {})}
        known = [one for one in _ORIENTATIONS if set(one[0].split()) == set(turns)]
        if known or _TRACKERS.search(f"{stream.name} {stem}"):
            axes, orientation, doubt = known[0] if known else ("", "xyzw", "")
            columns = tuple([position[axis] for axis in "xyz"] + [turns[axis] for axis in axes.split()])
            found.append(PoseColumns(columns, columns, orientation, doubt))
    return found
