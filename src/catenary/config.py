"""TOML and JSON read by their schemas, frozen dataclasses or pydantic models; complaints name the file and the key.

A dataclass is its own schema: what a field may be follows from its type, and `plain_data` writes what `parse_settings`
reads. `__pydantic_config__ = IN_FILES` has it refuse unknown keys; `alias_generator` there gives fields other names in
files, with units (`file_keys`).
"""

import json
from dataclasses import is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from catenary.bounded_parsers import MAX_TOML_BYTES, cut, json_value, read_bounded, shortened, toml_table
from catenary.errors import ConfigError, FileFormatError

_MAX_PROBLEMS = 10  # reported of one file at once
_adapters: dict[Any, TypeAdapter[Any]] = {}  # by schema: making one takes as long as reading a robot


IN_FILES = ConfigDict(extra="forbid", allow_inf_nan=False)  # of dataclasses that stand in files


class Settings(BaseModel):
    """Base of file schemas that are no dataclasses: frozen, unknown keys and infinite numbers refused."""

    model_config = ConfigDict(frozen=True, **IN_FILES)


class Recorded(Settings):
    """Base of the schemas of what catenary itself wrote: later versions may add keys, which are left out."""

    model_config = ConfigDict(extra="ignore")


Schema = TypeVar("Schema")


def file_keys(**keys: str) -> ConfigDict:
    """Return `IN_FILES` for a dataclass some of whose fields have other names in files: field="key"."""
    return ConfigDict(alias_generator=lambda field: keys.get(field, field), **IN_FILES)


def load_toml(path: Path, schema: type[Schema]) -> Schema:
    """Read a TOML file into a schema; ConfigError says where in the file it does not fit.

    Args:
        path, schema: The file, and the type that it is parsed into.
    """
    try:
        content = toml_table(read_bounded(path, MAX_TOML_BYTES), str(path))
    except FileFormatError as error:
        raise ConfigError(str(error)) from error
    return parse_settings(content, schema, str(path))


def parse_json(data: str | bytes, schema: type[Schema], where: str, *, finite: bool = True) -> Schema:
    """Parse JSON text into a schema.

    Args:
        data: Text, or its bytes in UTF-8.
        where: The text's source, which opens every message.
        finite: Whether NaN and infinity are refused.
    """
    return parse_settings(json_value(data, where, finite=finite), schema, where)


def parse_settings(content: Any, schema: type[Schema], where: str, context: Any = None) -> Schema:
    """Validate plain data against a schema; ConfigError has a line for each problem: where, expected, found.

    Args:
        content: Plain data: tables, lists, numbers, text.
        where: The data's source, which opens every message.
        context: Handed to the schema's validators.
    """
    try:
        # strict, as JSON: "1" or true is no number, while a list may fill a tuple and a text a path or a date
        data = json.dumps(content, default=str)
        checked: Schema = _adapter(schema).validate_json(data, strict=True, context=context)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        lines = [f"{where}: {_explain(problem, content, schema)}" for problem in problems[:_MAX_PROBLEMS]]
        if len(problems) > _MAX_PROBLEMS:
            lines.append(f"{where}: and {len(problems) - _MAX_PROBLEMS} more")
        raise ConfigError("\n".join(lines)) from error
    return checked


def plain_data(record: Any) -> Any:
    """Return a dataclass as the plain data that `parse_settings` makes it of again."""
    return _adapter(type(record)).dump_python(record, mode="json", by_alias=True)


def _adapter(schema: Any) -> TypeAdapter[Any]:
    if schema not in _adapters:
        _adapters[schema] = TypeAdapter(schema)
    return _adapters[schema]


def _explain(problem: Any, content: Any, schema: type[Any]) -> str:
    location: tuple[str | int, ...] = problem["loc"]
    key = _key_text(location, content)
    if problem["type"] in ("missing", "missing_argument"):
        return f"{key}: this key is missing"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
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


def _fields_at(schema: type[Any], location: tuple[str | int, ...]) -> set[str]:
    here: Any = schema
    for step in location:
        if not isinstance(step, int):
            here = _schema_inside(_keys(here).get(step))
    return set(_keys(here))


def _keys(schema: Any) -> dict[str, Any]:
    """Return a schema's keys in files, and the types of what they hold."""
    if isinstance(schema, type) and issubclass(schema, BaseModel):
        return {field.alias or name: field.annotation for name, field in schema.model_fields.items()}
    if not is_dataclass(schema):
        return {}
    alias = getattr(schema, "__pydantic_config__", {}).get("alias_generator", str)
    return {alias(name): hint for name, hint in get_type_hints(schema).items()}


def _schema_inside(annotation: Any) -> Any:
    if isinstance(annotation, type) and (is_dataclass(annotation) or issubclass(annotation, BaseModel)):
        return annotation
    inner = (_schema_inside(part) for part in getattr(annotation, "__args__", ()))
    return next((schema for schema in inner if schema is not None), None)
