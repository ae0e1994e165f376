"""What a project's JSON files hold: their schemas, and one way to read them."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, JsonValue

from catenary.config import Recorded, Settings, parse_settings
from catenary.documents import json_value, read_bounded
from catenary.errors import ConfigError, FileFormatError
from catenary.files import damage

MOST_STATE = 2**20  # [B]; steps.json of a hundred recordings has some 50 kB
Few = Field(max_length=1_000)  # joints
Count = Annotated[int, Field(ge=0)]


class SettingsFile(Settings):
    """settings.json; `ProjectSettings` knows what of it a robot or a motion can have."""

    robot: str = "raven2"
    side: str = "left"
    seed: Count | None = None
    base_tilt_deg: tuple[float, float]
    payload_kg: float = 0.0
    direction: str = "J2-J3"
    sparsities: tuple[float, ...]
    test_minutes: float = 20.0
    state_rate_hz: float = 30.0
    connection: str = "simulation"
    form: str = "generator"
    namespace: str = "/PSM1"
    train_minutes: float = 20.0
    columns: tuple[str, ...] = ()


class WrittenFile(Recorded):
    """A file that a step wrote."""

    size: Count
    mtime_ns: int
    sha256: str


class WrittenFiles(Recorded):
    """What a step wrote, by the files' names."""

    outputs: dict[str, WrittenFile]


class StepEntry(Recorded):
    """A step that was done; older versions noted no outputs, and one with nonsense for them is done again."""

    made_from: str
    files: tuple[str, ...]
    outputs: JsonValue = None


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


class DeployedTimes(Recorded):
    """Durations of a loop in microseconds."""

    median: float | None
    p99: float | None
    p999: float | None
    max: float | None


class DeployedJoint(Recorded):
    """Errors of a joint; null where the encoders said nothing."""

    name: str
    unit: str
    raw_rmse: float | None
    rmse: float | None
    outside_valid_range: float | None


class DeploymentFile(Recorded):
    """deployment.json."""

    ticks: Count
    rate_hz: float
    compute_us: DeployedTimes | None
    jitter_us: DeployedTimes | None
    correction_us: DeployedTimes | None
    overruns: Count | None  # null where nobody kept time
    real_time_priority: bool
    joints: tuple[DeployedJoint, ...]


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


def read_state(path: Path, schema: type[Settings], remedy: str, *, below: str | None = None) -> Any:
    """Read one of a project's JSON files, as plain data that its schema has seen.

    Args:
        path: The file.
        schema: What it must hold.
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
