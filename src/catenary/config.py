"""TOML files read into frozen pydantic models; every complaint names the file and the key."""

import json
import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from catenary.errors import ConfigError


class Settings(BaseModel):
    """Base of every file schema: frozen, unknown keys and infinite numbers refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Schema = TypeVar("Schema", bound=Settings)


def load_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a TOML file into its schema.

    Raises:
        ConfigError: File missing or not TOML; key unknown, missing, or of the wrong type.
    """
    try:
        with path.open("rb") as file:
            content = tomllib.load(file)
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such file") from error
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read as TOML: {error}") from error
    return parse_settings(content, schema, str(path))


def parse_settings(content: dict[str, Any], schema: type[Schema], where: str) -> Schema:
    """Check a dictionary against its schema.

    Raises:
        ConfigError: Key unknown, missing, or of the wrong type; `where` opens the message.
    """
    try:
        # strict, as JSON: "1" or true is no number, while a list may fill a tuple and a text a path or a date
        return schema.model_validate_json(json.dumps(content, default=str), strict=True)
    except ValidationError as error:
        lines = [f"{where}: {_explain(problem, content, schema)}" for problem in error.errors()]
        raise ConfigError("\n".join(lines)) from error


def _explain(problem: Any, content: dict[str, Any], schema: type[BaseModel]) -> str:
    location: tuple[str | int, ...] = problem["loc"]
    key = _key_text(location, content)
    if problem["type"] == "missing":
        return f"{key}: this key is missing"
    if problem["type"] == "extra_forbidden":
        known = sorted(_fields_at(schema, location[:-1]))
        return f"{key}: unknown key{_hint(str(location[-1]), known)} (known: {', '.join(known)})"
    return f"{key}: {problem['msg']}, got {problem['input']!r}"


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
            parts[-1] += f"[{step}]"
            here = here[step] if isinstance(here, list) and step < len(here) else None
            if isinstance(here, dict) and isinstance(here.get("name"), str):
                parts[-1] += f' "{here["name"]}"'
        else:
            parts.append(str(step))
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
