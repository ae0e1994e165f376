"""Columns of a recording that share their rows: a topic of a bag, or a table."""

import re
import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, Integers, without_missing
from catenary.bounded_parsers import cut
from catenary.errors import InputError

_MAX_NAMES_SHOWN = 12  # names that an error lists
# in names of columns
WORDS: dict[str, Any] = tomllib.loads((files("catenary.recording") / "data" / "words.toml").read_text("utf-8"))
_INDEXED = re.compile(r"(?P<base>.*)\[(?P<part>[^\[\]]*)\]\Z", re.DOTALL)


@dataclass(frozen=True)
class Stream:
    """A topic or a table as columns of numbers; NaN if a row has no such number."""

    name: str  # topic, or the name of the file
    type: str  # of messages, or "table"
    columns: Mapping[str, NDArray[Any]]  # each (M,) numbers; elements of arrays as "position[0]"
    rows: int  # M, or as many as there are where this is a sample of them
    # (M,) [ns] of headers, 0 where a message has none; None in a table, whose time is one of its columns
    stamp: Integers | None = None
    arrival: Integers | None = None  # (M,) [ns] at the recorder; None where nobody knows
    # joints, in the order of the first message, of arrays beside a list of names; their columns are "position[yaw]"
    joints: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, where the file states them beside the names
    constants: Mapping[str, float] = field(default_factory=dict)  # single numbers of a file, such as a rate
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # arrays of texts of a file
    dates: tuple[str, ...] = ()  # columns that were dates or times of day, now nanoseconds
    starts: tuple[int, ...] = (0,)  # rows of a table at which a recording begins
    began: float = 0.0  # [s since 1970] at time zero of a table's first recording, where its container says it
    notes: tuple[str, ...] = ()

    def numbers(self, column: str, to_si: float = 0.0) -> Floats:
        """Return a column (M,), NaN also where its number means that there was none."""
        return np.asarray(without_missing(self.columns[column], to_si), dtype=np.float64)

    def titled(self, column: str) -> str:
        """Return a column's name as the head of a CSV would have it, `q[0] [deg]`, where the file states its unit."""
        return f"{column} [{self.units[column]}]" if self.units.get(column) else column

    def with_column(self, name: str, values: NDArray[Any]) -> "Stream":
        """Return the stream with a column replaced."""
        return replace(self, columns={**self.columns, name: values})

    def part(self, first: int, last: int) -> "Stream":
        """Return rows from the first to the one before the last, which hold no more in memory than themselves."""
        columns = {name: values[first:last].copy() for name, values in self.columns.items()}
        stamp, arrival = (None if times is None else times[first:last] for times in (self.stamp, self.arrival))
        return replace(self, columns=columns, rows=min(last, self.rows) - first, stamp=stamp, arrival=arrival)


def joined(parts: Sequence[Stream]) -> Stream:
    """Return parts of one stream one behind the other; NaN where one lacks a column that others have."""
    if len(parts) == 1:
        return parts[0]
    lengths = [part.rows if part.stamp is None else len(part.stamp) for part in parts]

    def column(name: str) -> NDArray[Any]:
        pairs = zip(parts, lengths, strict=True)
        return np.concatenate([part.columns[name] if name in part.columns else np.full(n, np.nan) for part, n in pairs])

    def stamps(name: str) -> Integers | None:
        each = [getattr(part, name) for part in parts]
        return None if each[0] is None else np.concatenate(each)

    def in_order(several: Iterable[Iterable[str]]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for some in several for name in some))

    arrays = in_order(part.joints for part in parts)
    return replace(
        parts[0],
        columns={name: column(name) for name in in_order(part.columns for part in parts)},
        rows=sum(part.rows for part in parts),
        stamp=stamps("stamp"),
        arrival=stamps("arrival"),
        joints={array: in_order(part.joints.get(array, ()) for part in parts) for array in arrays},
        notes=in_order(part.notes for part in parts),
    )


@dataclass(frozen=True)
class Place:
    """Place of a column of numbers: stream and name."""

    stream: str
    column: str
    star: str = field(default="", compare=False)  # what the * of a pattern stands for in its name


def places_of(reference: str, streams: Sequence[Stream]) -> list[Place]:
    """Return the columns that a reference stands for, in order.

    A reference is the name of a column, of an array (`position`, all its elements), a part of one (`position[2]`,
    `position[0:6]`, `position[elbow]` by the name of the joint) or a pattern of whole names (`cmd_*`, `cmd_?`, in the
    file's order; names that differ in a number by that). In front of it stands a topic and a dot
    (`/arm/state.position`); of several tables, the name of the file and a colon.

    Args:
        reference: The reference.
        streams: Tables and topics of the recording.

    Raises:
        InputError: No such column, or several.
    """
    stem, colon, inner_name = reference.partition(":")
    candidates: list[tuple[Stream, str]] = []
    for stream in streams:
        if stream.type == "table":
            candidates.append((stream, reference))
            if colon and stem == stream.name:
                candidates.append((stream, inner_name))
        elif reference.startswith(f"{stream.name}."):
            candidates.append((stream, reference[len(stream.name) + 1 :]))
    places = [(s, inner, names) for s, inner in candidates if (names := _columns(inner, s))]
    if len({stream.name for stream, _, _ in places}) > 1:
        raise InputError(
            f'column "{cut(reference)}" is in {" and in ".join(stream.name for stream, _, _ in places)}; '
            f'write "{places[0][0].name}:{cut(reference)}"'
        )
    if not places:
        raise InputError(f'no column "{cut(reference)}"; {_choices(reference, streams)}')
    stream, inner, names = places[0]
    ends = [len(end) for end in inner.split("*")] if inner.count("*") == 1 else []
    return [Place(stream.name, name, name[ends[0] : len(name) - ends[1]] if ends else "") for name in names]


def natural(name: str) -> tuple[tuple[int, str], ...]:
    """Return a key by which q2 comes before q10."""
    parts = re.split(r"(\d+)", name)
    return tuple((int(part[:18]), "") if part.isdigit() else (-1, part) for part in parts)


def arrays_of(stream: Stream) -> dict[str, list[str]]:
    """Return the arrays of a stream: the columns of each, in order."""
    arrays: dict[str, list[str]] = {}
    for name in stream.columns:
        indexed = _INDEXED.match(name)
        if indexed and indexed["part"].isdigit():
            arrays.setdefault(indexed["base"], []).append(name)
    numbered = {base: sorted(names, key=natural) for base, names in arrays.items()}
    named = {base: [f"{base}[{joint}]" for joint in joints] for base, joints in stream.joints.items()}
    return numbered | named


def _columns(inner: str, stream: Stream) -> list[str]:
    if inner in stream.columns:
        return [inner]
    arrays = arrays_of(stream)
    if inner in arrays:
        return arrays[inner]
    indexed = _INDEXED.match(inner)
    if indexed:
        base, part = indexed["base"], indexed["part"]
        limits = re.fullmatch(r"(\d{0,9}):(\d{0,9})|(\d{1,9})", part)
        if limits and base in arrays:
            first = int(limits[1] or limits[3] or 0)
            last = int(limits[2] or (first + 1 if limits[3] else len(arrays[base])))
            return arrays[base][first:last] if first < last <= len(arrays[base]) else []
    if {*"*?"} & {*inner} and len(inner) <= 200 and inner.count("*") <= 4:
        found_names = [name for name in stream.columns if fnmatchcase(name, inner)]
        is_numbered = len({re.sub(r"\d+", "#", name) for name in found_names}) == 1
        return sorted(found_names, key=natural) if is_numbered else found_names
    return []


def _choices(reference: str, streams: Sequence[Stream]) -> str:
    """Return in words what there is in place of a reference."""
    own = [s for s in streams if s.type != "table" and reference.startswith(f"{s.name}.")]
    tables = [s for s in streams if s.type == "table"]
    if not own and not tables:
        return f"topics are {listed([stream.name for stream in streams])}"
    chosen = own or tables
    names = [f"{base}[0:{len(columns)}]" for stream in chosen for base, columns in arrays_of(stream).items()]
    names += [name for stream in chosen for name in stream.columns if not _INDEXED.match(name)]
    joints = [joint for stream in own for inner in stream.joints.values() for joint in inner]
    of_joints = f"; its joints are {listed(list(dict.fromkeys(joints)))}" if joints else ""
    return f"{', '.join(stream.name for stream in chosen)} has {listed(names)}{of_joints}"


def not_used(streams: Sequence[Stream], used: Mapping[str, Collection[str]]) -> tuple[str, ...]:
    """Return the unused parts of a recording: topics, arrays beside joints' names, columns (`tau1 ... tau7` as one).

    Args:
        streams: Tables and topics of the recording.
        used: Columns used of each stream.
    """
    unused: list[str] = []
    for stream in streams:
        mine = set(used.get(stream.name, ()))
        if stream.type != "table" and not mine:
            unused.append(stream.name)
        elif stream.type != "table":
            arrays = {f"{stream.name}.{array}": arrays_of(stream)[array] for array in stream.joints}
            unused += [name for name, columns in arrays.items() if columns and not mine & set(columns)]
        else:
            groups: dict[str, list[str]] = {}
            for column in stream.columns:
                indexed = _INDEXED.match(column)
                group = indexed["base"] if indexed else re.sub(r"\d+", "#", column)
                groups.setdefault(group, []).extend([column] * (column not in mine))
            unused += [ends(columns) for columns in groups.values() if columns]
    return tuple(unused)


def ends(names: Sequence[str]) -> str:
    """Return the first and last of names."""
    return names[0] if len(names) == 1 else f"{names[0]} ... {names[-1]}"


def listed(names: Sequence[str]) -> str:
    """Return names in a line; of many the first, and how many more there are."""
    more = f" and {len(names) - _MAX_NAMES_SHOWN} more" if len(names) > _MAX_NAMES_SHOWN else ""
    return ", ".join(map(cut, names[:_MAX_NAMES_SHOWN])) + more if names else "none"
