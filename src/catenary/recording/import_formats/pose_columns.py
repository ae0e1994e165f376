"""Poses of markers among the columns of a recording: of messages, of trackers' exports, of tables by their names."""

import re
from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.recording.import_formats.columns import Stream, ends
from catenary.recording.import_formats.table_time import is_nameless

# of geometry_msgs/Pose and Transform, and of what trackers' exports are read as
PARTS = (("position", "orientation"), ("translation", "rotation"))
_POINTS = ("position", "translation", "point")
_TRACKERS = re.compile(r"marker|track|ndi|polaris|aurora|atracsys|optitrack|motive|vicon|mocap|rigid", re.IGNORECASE)
_ARM = re.compile(r"/(PSM|MTM|ECM|SUJ)\w*|/arm\d", re.IGNORECASE)  # of the dVRK and the RAVEN-II
_UNIT = re.compile(r"[ _]?[\[(]?\b(mm|cm|m|deg|rad)[\])]?\Z")  # behind the name of a table's column
_POSITIONS = ("x y z", "tx ty tz", "px py pz", "pos_x pos_y pos_z")
_TURNS = (  # names of a table's columns, how a mapping calls them, and what may be wrong about that
    ("qx qy qz qw", "xyzw", ""),
    ("qw qx qy qz", "wxyz", ""),
    ("q0 qx qy qz", "wxyz", ""),
    ("rx ry rz", "vector", "axis times angle, as a UR says its tool, or angles about axes"),
    ("roll pitch yaw", "xyz", "turns about fixed axes, roll first, as ROS has them, or of another order"),
    ("", "xyzw", ""),
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
        return ends(self.references)


def poses_of(streams: Sequence[Stream]) -> list[PoseColumns]:
    """Return the poses that move, but the robot's own of its tool and those that it was told."""
    found = []
    for stream in streams:
        place, _, verb = stream.name.removesuffix("/").rpartition("/")
        place = place.removesuffix("/local")
        own = any(other.name.startswith(f"{place}/") and re.search(r"_j[spvf]\Z", other.name) for other in streams)
        if verb.endswith("_cp") and (verb != "measured_cp" or own or _ARM.match(place)):
            continue
        poses = [*poses_by_parts(stream), *(_by_names(stream) if stream.type == "table" else ())]
        found += [one for one in poses if any(_moves(stream.columns[column]) for column in one.taken)]
    return found


def _moves(values: NDArray[Any]) -> bool:
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and finite.max() > finite.min()


def poses_by_parts(stream: Stream) -> list[PoseColumns]:
    """Return poses such as pose.position.x ... pose.orientation.w, and points alone."""
    front, found = "" if stream.type == "table" else f"{stream.name}.", list[PoseColumns]()
    for name in [name for name in stream.columns if name.endswith(".x")]:
        point = name.removesuffix(".x")
        base, _, part = f".{point}".rpartition(".")
        if part not in _POINTS:
            continue
        positions, turn = tuple(f"{point}.{axis}" for axis in "xyz"), f"{base[1:]}.{dict(PARTS).get(part)}".lstrip(".")
        turns = tuple(f"{turn}.{axis}" for axis in "xyzw")
        if turns[-1] in stream.columns:
            found.append(PoseColumns((f"{front}{base[1:]}".rstrip("."),), positions + turns))
        elif set(positions) <= set(stream.columns):
            found.append(PoseColumns((f"{front}{point}",), positions))
    return found


def _by_names(stream: Stream) -> list[PoseColumns]:
    """Return poses of a table such as tx ty tz qx qy qz qw; positions alone where the name is a tracker's."""
    names = tuple(stream.columns)
    if len(names) == 8 and is_nameless(stream):  # TUM's trajectories: time, position, quaternion
        lengths = np.linalg.norm([stream.columns[name] for name in names[4:]], axis=0)
        if np.nanmax(np.abs(lengths - 1.0)) < 1e-2:
            return [PoseColumns(names[1:], names[1:])]
    bare, found = {_UNIT.sub("", name.lower()): name for name in names}, list[PoseColumns]()
    for position, (turns, orientation, doubt) in product(_POSITIONS, _TURNS):
        words = f"{position} {turns}".split()
        for stem in [name.removesuffix(words[0]) for name in bare if re.search(rf"(\A|[ ._/:]){words[0]}\Z", name)]:
            columns = tuple(bare[stem + word] for word in words if stem + word in bare)
            new = not any(set(columns) & set(one.taken) for one in found)
            if len(columns) == len(words) and new and (turns or _TRACKERS.search(f"{stream.name} {stem}")):
                found.append(PoseColumns(columns, columns, orientation, doubt))
    return found
