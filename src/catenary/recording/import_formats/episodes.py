"""Episodes of a container: which are meant by CONTAINER/EPISODE, and when they began."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import listed

# what says when an episode began: ISO 8601, seconds since 1970, or robosuite's month-day-year beside "time"
_DATES = ("date", "recorded", "recorded_at", "created", "created_at", "start_time", "timestamp")
_PARSERS = (
    datetime.fromisoformat,
    lambda text: datetime.strptime(text, "%m-%d-%Y %H:%M:%S"),
    lambda text: datetime.strptime(text, "%m-%d-%Y"),
)


def wanted_episodes(path: Path, names: Sequence[str], wanted: str) -> list[str]:
    """Return the episodes that are meant: all, or the one of a name or its number, `demo_3`, `episode_000003`, `3`."""
    asked = _short(wanted)
    found = [name for name in names if wanted in ("", name) or asked in (_short(name), _short(name).lstrip(_LETTERS))]
    if not found:
        raise FileFormatError(f'{path}: no episode "{cut(wanted)}"; its episodes are {listed(names)}')
    return found


_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_- "


def _short(name: str) -> str:
    return re.sub(r"0+(?=\d+\Z)", "", name.rpartition("/")[2])


def in_a_row(path: Path, names: Sequence[str], begins: Sequence[float]) -> list[str]:
    """Return what is said of episodes that stand one behind the other; they began then [s since 1970], or 0."""
    alone = f"{path}/{names[0]}"
    if all(begins) and len(set(begins)) > 1:
        dates = [datetime.fromtimestamp(began, UTC).isoformat(" ", "seconds")[:19] for began in begins]
        names = [f"{name} ({date})" for name, date in zip(names, dates, strict=True)]
    said = f"{len(names)} episodes, one behind the other: {listed(names)}; {alone} is one alone"
    return [said] * (len(names) > 1)


def began_of(told: Mapping[str, Any]) -> float:
    """Return when an episode began [s since 1970, UTC], by what its container tells; 0 where it does not."""
    for key in _DATES:
        value = told.get(key)
        if isinstance(value, int | float) and 1e9 < value < 1e10:
            return float(value)
        texts = [f"{value} {told.get('time')}", value] if key == "date" else [value]
        for text, parse in ((text, parse) for text in texts if isinstance(text, str) for parse in _PARSERS):
            with suppress(ValueError):
                moment = parse(text)
                return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return 0.0
