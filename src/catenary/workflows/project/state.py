"""What a project's JSON files hold, and what its steps wrote: the size, time and SHA-256 of every file."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from catenary.config import Recorded, parse_settings
from catenary.documents import json_value, read_bounded
from catenary.errors import ConfigError, FileFormatError
from catenary.files import damage, fingerprint, sha256_of

MOST_STATE = 2**20  # [B]; steps.json of a hundred recordings has some 50 kB
Count = Annotated[int, Field(ge=0)]


class WrittenFile(Recorded):
    """A file that a step wrote."""

    size: Count
    mtime_ns: int
    sha256: str


class StepEntry(Recorded):
    """A step that was done, and what it wrote, by the files' names."""

    made_from: str
    files: tuple[str, ...]
    outputs: dict[str, WrittenFile]


class StepsFile(Recorded):
    """steps.json, below the key `steps`."""

    steps: dict[str, StepEntry]


def read_state(path: Path, schema: type[Any], remedy: str, *, below: str | None = None) -> Any:
    """Read a project's JSON file by its schema, whole or below a key; ConfigError names it and ends with the remedy."""
    try:
        content = json_value(read_bounded(path, MOST_STATE), str(path))
        parse_settings(content if below is None else {below: content}, schema, str(path))
    except FileFormatError as error:
        why = str(error).removeprefix(f"{path}: ").replace(f"\n{path}: ", "; ")
        raise ConfigError(damage(path, why, remedy)) from error
    return content


def describe(folder: Path, outputs: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Return `size`, `mtime_ns`, `sha256` of a step's files by their path, once their bytes are on the disk (fsync)."""
    described = {}
    for output in outputs:
        for path in _files(output):
            try:
                with path.open("rb") as file:
                    os.fsync(file.fileno())
                content = _size_and_time(path) | {"sha256": sha256_of(path)}
            except OSError as error:
                raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
            described[path.relative_to(folder).as_posix()] = content
    return described


def missing(outputs: Sequence[Path]) -> list[Path]:
    """Return the outputs that are not there, folders without a file among them."""
    return [output for output in outputs if next(_files(output), None) is None]


def hold(folder: Path, outputs: Sequence[Path], described: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether files still hold what `describe` saw; one of the same size and time is believed, not hashed."""
    there = {path.relative_to(folder).as_posix(): path for output in outputs for path in _files(output)}
    return there.keys() == described.keys() and all(_holds(path, described[name]) for name, path in there.items())


def contents(described: Mapping[str, Mapping[str, Any]], output: str) -> str:
    """Return the hash of what the files below an output hold, by their names; times do not count."""
    below = {name: one["sha256"] for name, one in described.items() if name.startswith(f"{output}/")}
    return fingerprint(below)


def _holds(path: Path, described: Mapping[str, Any]) -> bool:
    try:
        now = _size_and_time(path)
        if now["size"] != described["size"]:
            return False
        return bool(now["mtime_ns"] == described["mtime_ns"] or sha256_of(path) == described["sha256"])
    except OSError:
        return False


def _size_and_time(path: Path) -> dict[str, int]:
    status = path.stat()
    return {"size": status.st_size, "mtime_ns": status.st_mtime_ns}


def _files(output: Path) -> Iterator[Path]:
    if not output.is_dir():
        if output.is_file():
            yield output
        return
    for folder, _, names in os.walk(output):
        yield from (path for name in sorted(names) if (path := Path(folder, name)).is_file())
