"""TOML and JSON read into frozen pydantic models, the schemas; every complaint names the file and the key."""

import json
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from catenary.documents import MOST_JSON, MOST_TOML, cut, json_value, read_bounded, shortened, toml_table
from catenary.errors import ConfigError, FileFormatError

MOST_PROBLEMS = 10  # of one file that are told at once


class Settings(BaseModel):
    """Base of every file schema: frozen, unknown keys and infinite numbers refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Recorded(Settings):
    """Base of the schemas of what catenary itself wrote: later versions may add keys, which are left out."""

    model_config = ConfigDict(extra="ignore")


Schema = TypeVar("Schema", bound=Settings)


def load_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a TOML file into its schema.

    Raises:
        ConfigError: File missing or not TOML; key unknown, missing, or of the wrong type.
    """
    try:
        content = toml_table(read_bounded(path, MOST_TOML), str(path))
    except FileFormatError as error:
        raise ConfigError(str(error)) from error
    return parse_settings(content, schema, str(path))


def load_json(path: Path, schema: type[Schema]) -> Schema:
    """Read a JSON file into its schema.

    Raises:
        FileFormatError: File missing or not JSON.
        ConfigError: Key unknown, missing, or of the wrong type.
    """
    return parse_json(read_bounded(path, MOST_JSON), schema, str(path))


def parse_json(data: str | bytes, schema: type[Schema], where: str, *, finite: bool = True) -> Schema:
    """Read JSON text into its schema; `where` opens every message, `finite` as in `json_value`.

    Raises:
        FileFormatError: Not JSON, or beyond the bounds of `json_value`.
        ConfigError: Key unknown, missing, or of the wrong type.
    """
    return parse_settings(json_value(data, where, finite=finite), schema, where)


def parse_settings(content: Any, schema: type[Schema], where: str) -> Schema:
    """Check plain data against its schema.

    Raises:
        ConfigError: Key unknown, missing, or of the wrong type; `where` opens the message.
    """
    try:
        # strict, as JSON: "1" or true is no number, while a list may fill a tuple and a text a path or a date
        return schema.model_validate_json(json.dumps(content, default=str), strict=True)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        lines = [f"{where}: {_explain(problem, content, schema)}" for problem in problems[:MOST_PROBLEMS]]
        if len(problems) > MOST_PROBLEMS:
            lines.append(f"{where}: and {len(problems) - MOST_PROBLEMS} more")
        raise ConfigError("\n".join(lines)) from error


def _explain(problem: Any, content: Any, schema: type[BaseModel]) -> str:
    location: tuple[str | int, ...] = problem["loc"]
    key = _key_text(location, content)
    if problem["type"] == "missing":
        return f"{key}: this key is missing"
    if problem["type"] == "extra_forbidden":
        known = sorted(_fields_at(schema, location[:-1]))
        hint = _hint(cut(str(location[-1])), known)  # comparing takes a time that grows with the key's length
        return f"{key}: unknown key{hint} (known: {', '.join(known)})"
    return f"{key}: {problem['msg']}, got {shortened(problem['input'])}"


def _hint(key: str, known: list[str]) -> str:
    """Suggest the key that was meant; one without its unit is the likeliest mistake."""
    with_unit = [name for name in known if name.startswith(f"{key}_")]
    if with_unit:
        return f"; a number's key ends in its unit: {' or '.join(with_unit)}"
    close = get_close_matches(key, known, n=1, cutoff=0.6)
    return f'; did you mean "{close[0]}"?' if close else ""


def _key_text(location: tuple[str | int, ...], content: Any) -> str:
    """Write link.2.a_m as `link[2] "elbow": a_m`, naming the row where it has a name."""
    parts: list[str] = []
    here = content
    for step in location:
        if isinstance(step, int):
            parts = [*parts[:-1], f"{parts[-1] if parts else ''}[{step}]"]
            here = here[step] if isinstance(here, list) and step < len(here) else None
            if isinstance(here, dict) and isinstance(here.get("name"), str):
                parts[-1] += f' "{cut(here["name"])}"'
        else:
            parts.append(cut(str(step)))
            here = here.get(step) if isinstance(here, dict) else None
    return ": ".join(parts) if parts else "file"


def _fields_at(schema: type[BaseModel], location: tuple[str | int, ...]) -> set[str]:
    here: Any = schema
    for step in location:
        if isinstance(step, int):
            continue
        field = here.model_fields.get(step) if hasattr(here, "model_fields") else None
        here = _model_inside(field.annotation) if field is not None else None
    return set(here.model_fields) if here is not None and hasattr(here, "model_fields") else set()


def _model_inside(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        found = _model_inside(inner)
        if found is not None:
            return found
    return None
