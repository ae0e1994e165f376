"""The joints that columns are of: their names, their units, and what turns the columns into SI."""

import re
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.errors import InputError
from catenary.plant import Jointed, Joints, joints_text, nameless, places_of
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import SI, Quantity, RecordingMapping
from catenary.robots.model import RobotModel

# messages of ROS whose joints are in rad and m by definition [REP 103]
_TYPES_IN_SI = ("JointState", "JointTrajectoryControllerState")
Value = TypeVar("Value")


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


def joint_units_of(
    mapping: RecordingMapping,
    model: RobotModel | None,
    base: Place,
    streams: Sequence[Stream],
    names: Sequence[str],
) -> tuple[tuple[str, ...], bool, list[str]]:
    """Return the joints' SI units, whether they were assumed, and what to say of it."""
    n = len(names)
    given: tuple[str, ...] | None = mapping.joint_units or None
    if model is not None and given is None:
        given = tuple(model.joint_units[model.joint_names.index(joint)] for joint in names)
    if given is not None and len(given) == 1:
        given = given * n
    if given is not None and len(given) != n:
        raise InputError(f"joint_units: {len(given)} for {n} joints")
    stated, _ = factors("q_nominal", mapping.q_nominal, given, n)
    if stated is not None:
        return stated, False, []
    kind = next(stream.type for stream in streams if stream.name == base.stream)
    if given is not None:
        assumed = kind == "table"
        return (
            given,
            assumed,
            [f"q_nominal: its units were not stated; taken in {', '.join(given)}"] * assumed,
        )
    if kind.rpartition("/")[2] in _TYPES_IN_SI:
        return (
            ("rad",) * n,
            True,
            [f"{kind} is in rad and m: all joints were taken to turn; --units says otherwise"],
        )
    raise InputError(
        f"units of q_nominal are not stated; give --units with one of rad, deg, m, mm for each of {', '.join(names)}, "
        "or the robot"
    )


def factors(
    name: str, quantity: Quantity, joint_units: Sequence[str] | None, n: int
) -> tuple[tuple[str, ...] | None, Floats]:
    """Return the units of joints that a quantity's units stand for, or None, and what turns its numbers into SI, (n,).

    Args:
        name: Of the quantity, for messages.
        quantity: With units, scales and signs.
        joint_units: "rad" or "m" for each joint, where they are known.
        n: Number of its columns.
    """
    units = _each(f"{name}: units", quantity.units, n)
    scale = np.array(_each(f"{name}: scale", quantity.scale, n) or (1.0,) * n)
    scale = scale * np.array(_each(f"{name}: sign", quantity.sign, n) or (1.0,) * n)
    if name == "tau":
        return None, scale
    if units is None:
        return None, scale
    if "counts" in units and not quantity.scale:
        raise InputError(
            f"{name}: counts: give the scale, rad or m per count (@counts*SCALE, or scale = ...)"
        )
    if "counts" in units and joint_units is None:
        raise InputError(f'{name}: counts of which unit? give joint_units = ["rad", ...], or the robot')
    said = tuple(
        joint_units[i] if unit == "counts" and joint_units is not None else SI[unit][0]
        for i, unit in enumerate(units)
    )
    if joint_units is not None and said != tuple(joint_units):
        raise InputError(
            f"{name}: units {', '.join(units)}, but the joints' are {', '.join(joint_units)}; expected deg or rad for "
            "joints that turn, mm or m for those that slide"
        )
    return said, scale * np.array([1.0 if unit == "counts" else SI[unit][1] for unit in units])


def _each(what: str, values: tuple[Value, ...], n: int) -> tuple[Value, ...] | None:
    if not values:
        return None
    if len(values) not in (1, n):
        raise InputError(f"{what}: {len(values)} for {n} columns, expected one, or one for each")
    return values * n if len(values) == 1 else values
