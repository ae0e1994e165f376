"""Poses of markers among the columns of a recording: of messages, of trackers' exports, of tables by their names."""

import re
from collections.abc import Collection, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.recording.import_formats.columns import WORDS, Stream, arrays_of, ends
from catenary.recording.import_formats.table_time import is_nameless

# of geometry_msgs/Pose and Transform, and of what trackers' exports are read as
PARTS = (("position", "orientation"), ("translation", "rotation"))
_POINTS = ("position", "translation", "point")
_TRACKERS = re.compile(r"marker|track|ndi|polaris|aurora|atracsys|optitrack|motive|vicon|mocap|rigid", re.IGNORECASE)
_ARM = re.compile(r"/(PSM|MTM|ECM|SUJ)\w*|/arm\d", re.IGNORECASE)  # of the dVRK and the RAVEN-II
_UNIT = re.compile(r"(?:[ _]|(?=[\[(]))[\[(]?(mm|cm|m|deg|rad)[\])]?\Z")  # behind the name of a table's column
_FAR = 20.0  # beyond which a position is in mm, no tracker seeing so far in m
_SENT_AWAY = 1e6  # numbers by which a tracker says that it saw nothing
_LARGEST_TURN = 7.0  # beyond which an angle is in deg


class PoseColumns(NamedTuple):
    """A pose, or a position alone, as a mapping names it."""

    references: tuple[str, ...]
    taken: tuple[str, ...]  # columns of the stream
    orientation: str = "xyzw"
    doubt: str = ""  # about the orientation
    units: tuple[str, str] = ("m", "rad")  # of position and angles
    stream: str = ""
    is_own: bool = False  # of the arm whose joints stand beside it under the same name: measured_x, measured_q1

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
        poses = poses_by_parts(stream)
        poses += _by_names(stream, {name for pose in poses for name in pose.taken}) if stream.type == "table" else []
        moving = [one for one in poses if any(_moves(stream.columns[column]) for column in one.taken)]
        found += [one._replace(units=_units(stream, one), stream=stream.name) for one in moving]
    return found


def _moves(values: NDArray[Any]) -> bool:
    finite = values[np.isfinite(values)]
    return len(finite) > 0 and finite.max() > finite.min()


def _units(stream: Stream, pose: PoseColumns) -> tuple[str, str]:
    """Return the units of a pose's position and angles, by the names of its columns or by their size."""

    def unit(columns: Sequence[str], most: float, small: str, large: str) -> str:
        named = _UNIT.search(columns[0]) if columns and stream.type == "table" else None
        sizes = np.abs([np.asarray(stream.columns[column], dtype=np.float64) for column in columns])
        return named[1] if named else large if (sizes[sizes < _SENT_AWAY] > most).any() else small

    return unit(pose.taken[:3], _FAR, "m", "mm"), unit(pose.taken[3:], _LARGEST_TURN, "rad", "deg")


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


def _by_names(stream: Stream, taken: Collection[str]) -> list[PoseColumns]:
    """Return poses of a table such as tx ty tz qx qy qz qw; positions alone where the name is a tracker's."""
    names, found = tuple(name for name in stream.columns if name not in taken), list[PoseColumns]()

    def is_turn(columns: Sequence[str]) -> bool:
        lengths = np.linalg.norm([np.asarray(stream.columns[name], dtype=np.float64) for name in columns], axis=0)
        return len(columns) < 4 or bool(np.all(np.abs(lengths[(lengths > 0.0) & np.isfinite(lengths)] - 1.0) < 1e-2))

    if len(names) == 8 and is_nameless(stream) and is_turn(names[4:]):  # TUM's trajectories: time, position, quaternion
        return [PoseColumns(names[1:], names[1:])]
    bare = {_UNIT.sub("", name.lower()): name for name in names}
    for (turns, orientation, doubt), position in product(WORDS["poses"]["turns"], WORDS["poses"]["positions"]):
        words = f"{position} {turns}".split()
        for stem in [name.removesuffix(words[0]) for name in bare if re.search(rf"(\A|[ ._/:]){words[0]}\Z", name)]:
            columns = tuple(bare[stem + word] for word in words if stem + word in bare)
            new = not any(set(columns) & set(one.taken) for one in found)
            is_pose = turns or _TRACKERS.search(f"{stream.name} {stem}")
            if len(columns) == len(words) and new and is_pose and is_turn(columns[3:]):
                own = stem != "" and any(re.match(rf"{re.escape(stem)}(q|jp|joint_?)[1-9]", name) for name in bare)
                found.append(PoseColumns(columns, columns, orientation, doubt, is_own=own))
    points = {base: columns for base, columns in arrays_of(stream).items() if len(columns) == 3}
    for base in [base for base in points if _TRACKERS.search(base) and re.search("position|translation|xyz", base)]:
        found.append(PoseColumns(tuple(points[base]), tuple(points[base])))
    return found
