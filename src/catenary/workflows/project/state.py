"""What a project's JSON files hold: their schemas, and one way to read them."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from catenary.config import Recorded, parse_settings
from catenary.documents import json_value, read_bounded
from catenary.errors import ConfigError, FileFormatError
from catenary.files import damage

MOST_STATE = 2**20  # [B]; steps.json of a hundred recordings has some 50 kB
Few = Field(max_length=1_000)  # joints
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


class HomeFile(Recorded):
    """robot/home.json: what is believed is known; an encoder may be missing."""

    simulated: bool
    seconds: float | None = None
    joint_names: Annotated[tuple[str, ...], Few]
    believed: Annotated[tuple[float, ...], Few]
    external_encoders: Annotated[tuple[float | None, ...], Few] | None = None


class ExtractedTopic(Recorded):
    """A topic that was extracted; rates are null of a single message."""

    topic: str
    messages: Count
    rate: float | None
    longest_gap: float | None


class ExtractionFile(Recorded):
    """NAME.synchronised.json."""

    topics: tuple[ExtractedTopic, ...]
    rows: Count
    problems: tuple[str, ...]


def read_state(path: Path, schema: type[Any], remedy: str, *, below: str | None = None) -> Any:
    """Read one of a project's JSON files, as plain data that its schema has seen.

    Args:
        remedy: What makes it again, for the message.
        below: Key of the schema that stands for the whole file.

    Raises:
        ConfigError: It is missing, empty, no JSON, or holds something else; the message names it and ends with the
            remedy.
    """
    try:
        content = json_value(read_bounded(path, MOST_STATE), str(path))
        parse_settings(content if below is None else {below: content}, schema, str(path))
    except FileFormatError as error:
        why = str(error).removeprefix(f"{path}: ").replace(f"\n{path}: ", "; ")
        raise ConfigError(damage(path, why, remedy)) from error
    return content
