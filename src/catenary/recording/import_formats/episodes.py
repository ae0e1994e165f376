"""Containers of many recordings: episodes one behind the other in a table, or one alone, CONTAINER/EPISODE."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import MOST_SHOWN, Stream
from catenary.recording.import_formats.table_files import streams_of_arrays
from catenary.recording.import_formats.table_time import time_columns
from catenary.topics import SECOND

# what says when an episode began: ISO 8601, seconds since 1970, or robosuite's month-day-year beside "time"
_DATES = ("date", "recorded", "recorded_at", "created", "created_at", "start_time", "timestamp")
_AMERICAN = ("%m-%d-%Y %H:%M:%S", "%m-%d-%Y")
_SINCE_1970 = (1e9, 1e10)  # [s]
_NUMBERED = re.compile(r"(?P<stem>.*?)(?P<number>\d{1,9})\Z", re.DOTALL)


class Episode(NamedTuple):
    """One recording of a container."""

    name: str
    arrays: Mapping[str, NDArray[Any]]  # (N,) or (N, k)
    rate: float | None = None  # [Hz] of rows
    began: int | None = None  # [ns] since 1970


def wanted_episodes(path: Path, names: Sequence[str], wanted: str) -> list[str]:
    """Return the episodes that are meant: all, or the one of a name or its number, `demo_3`, `episode_000003`, `3`."""
    if not wanted:
        return list(names)
    found = [name for name in names if wanted in (name, name.rpartition("/")[2])]
    found = found or [name for name in names if _is_number_of(wanted, name.rpartition("/")[2])]
    if len(found) != 1:
        more = f" and {len(names) - MOST_SHOWN} more" if len(names) > MOST_SHOWN else ""
        choices = ", ".join(map(cut, names[:MOST_SHOWN])) + more if names else "none"
        raise FileFormatError(f'{path}: no episode "{cut(wanted)}"; its episodes are {choices}')
    return found


def _is_number_of(wanted: str, name: str) -> bool:
    mine, its = _NUMBERED.match(wanted), _NUMBERED.match(name)
    if mine is None or its is None or mine["stem"] not in ("", its["stem"]):
        return False
    return int(mine["number"]) == int(its["number"])


def began_of(told: Mapping[str, Any]) -> int | None:
    """Return when an episode began [ns since 1970, UTC], by what its container tells; None where it does not."""
    for key in _DATES:
        value = told.get(key)
        if isinstance(value, int | float) and _SINCE_1970[0] < value < _SINCE_1970[1]:
            return round(value * SECOND)
        if not isinstance(value, str):
            continue
        texts = [value] if key != "date" or "time" not in told else [f"{value} {told['time']}", value]
        for text in texts:
            with suppress(ValueError):
                return _nanoseconds(datetime.fromisoformat(text))
            for form in _AMERICAN:
                with suppress(ValueError):
                    return _nanoseconds(datetime.strptime(text, form))
    return None


def _nanoseconds(moment: datetime) -> int:
    return round((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() * 1e6) * 1000


def streams_of_episodes(path: Path, episodes: Sequence[Episode], notes: Sequence[str] = ()) -> list[Stream]:
    """Return the arrays that all episodes have, those of one behind those of the other, with a time where a rate is.

    Rows that begin an episode are the streams' `starts`; times count from there, or are stamps where dates are known.
    """
    said = list(notes)
    first, several = episodes[0], len(episodes) > 1
    if several:
        shared, left = {}, []
        for name in dict.fromkeys(name for episode in episodes for name in episode.arrays):
            parts = [episode.arrays[name] for episode in episodes if name in episode.arrays]
            if len(parts) == len(episodes) and len({part.shape[1:] for part in parts}) == 1 and parts[0].ndim:
                shared[name] = np.concatenate(parts)
            elif len(parts) == len(episodes) and all(np.array_equal(part, parts[0]) for part in parts):
                shared[name] = parts[0]  # such as a rate
            else:
                left.append(name)
        told = ", ".join(f"{cut(episode.name)}" for episode in episodes[:MOST_SHOWN])
        more = f" and {len(episodes) - MOST_SHOWN} more" if len(episodes) > MOST_SHOWN else ""
        said.append(f"{len(episodes)} episodes, one behind the other: {told}{more}; {path}/{first.name} is one alone")
        said += [f"{', '.join(map(cut, left[:10]))}: not alike in all episodes, and left out"] * bool(left)
        streams = streams_of_arrays(path, shared, rows_first=True)
    else:
        streams = streams_of_arrays(path, first.arrays)
    made = []
    for stream in streams:
        array = next(iter(stream.columns)).rpartition("[")[0] or next(iter(stream.columns))
        lengths = [len(episode.arrays[array]) for episode in episodes] if several else [stream.rows]
        starts = tuple(int(start) for start in np.cumsum([0, *lengths[:-1]]))
        columns = _timed(stream, episodes, lengths) if stream is streams[0] or several else stream.columns
        made.append(replace(stream, columns=columns, starts=starts, notes=(*said, *stream.notes)))
        said = []
    return made


def _timed(stream: Stream, episodes: Sequence[Episode], lengths: Sequence[int]) -> Mapping[str, NDArray[Any]]:
    """Return columns with their time first: their own or by the rate, since 1970 where all episodes have a date."""
    named = time_columns(stream)
    if len(named) > 1 or (not named and any(episode.rate is None for episode in episodes)):
        return stream.columns
    name = named[0] if named else "time"
    ends = np.cumsum(lengths)
    parts = []
    for episode, length, end in zip(episodes, lengths, ends.tolist(), strict=True):
        own = stream.columns[name][end - length : end] if named else np.arange(length) / (episode.rate or 1.0)
        if (
            all(each.began is not None for each in episodes)
            and own.dtype.kind == "f"
            and not own.max() > _SINCE_1970[0]
        ):
            own = (episode.began or 0) + np.rint(own * SECOND).astype(np.int64)
        parts.append(own)
    return {name: np.concatenate(parts)} | {key: values for key, values in stream.columns.items() if key != name}
