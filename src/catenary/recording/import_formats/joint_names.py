"""The names of the joints that columns are of: the mapping's, the robot's, or the recording's own."""

import re
from collections.abc import Sequence

from catenary.documents import cut
from catenary.errors import InputError
from catenary.plant import Jointed, Joints, joints_text, nameless, places_of
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.robots.model import RobotModel


def joint_names_of(
    mapping: RecordingMapping, model: RobotModel | None, places: Sequence[Place], streams: Sequence[Stream]
) -> tuple[tuple[str, ...], list[str]]:
    """Return the joints' names: the mapping's, the robot's that the recording's mean, its own, or J1, J2, ..."""
    n = len(places)
    if mapping.joint_names:
        if len(mapping.joint_names) != n:
            raise InputError(f"joint_names: {len(mapping.joint_names)} for {n} columns of q_nominal")
        if model is not None:
            places_of(Joints(mapping.joint_names), model, whose=f'robot "{model.name}"', of="joint_names are")
        return mapping.joint_names, []
    own = recorded_joints(places, streams)
    if model is None:
        return own or nameless(n), []
    if n > model.n:
        raise InputError(
            f'robot "{model.name}" has {model.n} joints, q_nominal {n} columns; give joint_names'
        )
    said = own or tuple(place.column for place in places)
    meant = joints_meant(said, model)
    is_known, listed = all(meant) and len(set(meant)) == n, len(mapping.q_nominal.columns) == n
    names = meant if is_known else model.joint_names[:n]
    # a number in a column's name is hardly that of a joint, where not all of them are
    astray = any(each not in ("", j) and not each[-1].isdigit() for j, each in zip(names, meant, strict=True))
    if astray or (own and not is_known and not listed):
        raise InputError(
            f'q_nominal: {", ".join(map(cut, said))} are not clearly joints of robot "{model.name}", which has '
            f"{joints_text(model)}; list the columns in the order of its joints, or give joint_names"
        )
    told = f"{'by their names' if is_known else 'in order'} ({', '.join(map(cut, said))} in the recording)"
    note = f'columns of q_nominal are {", ".join(names)} of robot "{model.name}", {told}'
    return names, [note] * (names != said)


def joints_meant(names: Sequence[str], model: Jointed) -> tuple[str, ...]:
    """Return the robot's joint that each name means, its own or the longest whose words stand in it; "" for none.

    What all of the robot's joints have in their names ("joint", "q") need not stand there.
    """
    words = {joint: _words(joint) for joint in model.joint_names}
    shared = set.intersection(*map(set, words.values())) if len(words) > 1 else set[str]()
    keys = {joint: " ".join(w for w in each if w not in shared) for joint, each in words.items()}
    found = []
    for name in names:
        inside = [joint for joint, key in keys.items() if key and f" {key} " in f" {' '.join(_words(name))} "]
        longest = max(map(len, map(keys.__getitem__, inside)), default=0)
        best = [name] if name in keys else [joint for joint in inside if len(keys[joint]) == longest]
        found.append(best[0] if len(best) == 1 else "")
    return tuple(found)


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower())


def recorded_joints(places: Sequence[Place], streams: Sequence[Stream]) -> tuple[str, ...]:
    """Return the names that the recording gives columns' joints; empty where one has none, or two have one."""
    own = []
    for place in places:
        stream = next(s for s in streams if s.name == place.stream)
        array, _, rest = place.column.partition("[")
        own.append(rest[:-1] if rest[:-1] in stream.joints.get(array, ()) else "")
    return tuple(own) if all(own) and len(set(own)) == len(own) else ()
