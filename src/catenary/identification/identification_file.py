"""Identified parameters on disk: a NumPy archive that executes nothing, with its card inside and beside it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, make_dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from catenary import __version__
from catenary.archives import content_in_words, read_arrays
from catenary.bounded_parsers import cut
from catenary.cards import card_of, write_with_card
from catenary.config import IN_FILES, parse_settings, plain_data
from catenary.errors import FileFormatError, InputError
from catenary.identification.base_parameters import BaseParameters, Parameters
from catenary.identification.identification import Identification
from catenary.robots.model_record import FORMAT, IDENTIFIED, REMEDY, robot_from_record, robot_record, structure_of

Card = dict[str, Any]


_NUMBERS = ("beta", "covariance", "weights")
_ARRAYS = ("base", *_NUMBERS, "phi", "unshown")
_TYPES = get_type_hints(Identification)
_OWN_FIELDS = tuple(field.name for field in fields(Identification) if field.name not in _ARRAYS)
# all of an identification but its arrays; `robot_from_record` knows the schema of the robot
IdentificationRecord: Any = make_dataclass(
    "IdentificationRecord",
    [("format", str), ("robot", Any), *((name, _TYPES[name]) for name in _OWN_FIELDS)],
    frozen=True,
    namespace={"__pydantic_config__": IN_FILES},
)


def _record(result: Identification, robot: Any) -> dict[str, Any]:
    own = {name: getattr(result, name) for name in _OWN_FIELDS}
    return plain_data(IdentificationRecord(FORMAT, robot, **own))


def identification_card(
    result: Identification,
    data: list[dict[str, Any]],
    notes: tuple[str, ...] = (),
    mends: Mapping[str, Sequence[str]] | None = None,
) -> Card:
    """Return the card of an identification: what a user must know before relying on its parameters.

    Args:
        data: Record of each recording: name, hash, role.
        mends: Corrections of the recordings, by name.
    """
    base = result.base
    numbers = zip(base.names, result.beta.tolist(), result.std.tolist(), base.units, strict=True)
    return {
        "robot": result.model.name,
        "joints": [
            {"name": n, "unit": u} for n, u in zip(result.model.joint_names, result.model.joint_units, strict=True)
        ],
        **{name: value for name, value in _record(result, None).items() if name in _OWN_FIELDS},
        "n_base": base.count,
        "physically_consistent": result.phi is not None,
        "parameters": [
            {"name": name, "value": value, "std": std, "unit": unit, "is": base.describe(i)}
            for i, (name, value, std, unit) in enumerate(numbers)
        ],
        "data": data,
        "mends": {key: list(texts) for key, texts in (mends or {}).items()},
        "notes": list(notes),
        "version": {"catenary": __version__, "numpy": np.__version__},
    }


def save_identification(result: Identification, card: Card, path: Path) -> None:
    """Write an identification, and a readable copy of its card beside it.

    Args:
        result, card, path: The identification, its card, and the archive (.npz).
    """
    arrays: dict[str, Any] = {
        "structure": np.array(json.dumps(_record(result, robot_record(result.model)))),
        **{key: getattr(result.base, key) for key in ("columns", "combination")},
        **{key: getattr(result, key) for key in _NUMBERS},
    }
    if result.phi is not None:
        arrays["phi"] = result.phi
        arrays[IDENTIFIED] = np.array(json.dumps(robot_record(result.robot())))
    write_with_card(path, arrays, card)


def load_identification(path: Path) -> tuple[Identification, Card]:
    """Read an identification and its card."""
    arrays = read_arrays(path)
    if not {"structure", "card", "beta", "combination"} <= set(arrays):
        raise FileFormatError(
            f"{path}: holds no identified parameters ({content_in_words(arrays)}); "
            "they are written by catenary identify"
        )
    try:
        record = parse_settings(structure_of(arrays), IdentificationRecord, "structure")
        parameters = Parameters(robot_from_record(record.robot), record.options.terms)
        b, k, n = len(arrays["beta"]), len(parameters.names), parameters.model.n
        shapes = {"combination": (b, k), "columns": (b,), "beta": (b,), "covariance": (b, b), "weights": (n,)}
        if "phi" in arrays:
            shapes["phi"] = (k,)
        for key, shape in shapes.items():
            if arrays[key].shape != shape or not np.isfinite(arrays[key]).all():
                raise ValueError(f"{key} has shape {arrays[key].shape}, expected {shape} of finite numbers")
        stated: dict[str, Any] = {key: arrays[key] for key in _NUMBERS}
        stated |= {name: getattr(record, name) for name in _OWN_FIELDS}
        columns = arrays["columns"].astype(np.int64)
        if b == 0 or columns.min() < 0 or columns.max() >= k:
            raise ValueError(f"columns outside 0 to {k - 1}")
        result = Identification(
            base=BaseParameters(parameters, columns, arrays["combination"]), phi=arrays.get("phi"), **stated
        )
        if record.seen is not None and any(values.shape != (n,) for values in vars(record.seen).values()):
            raise ValueError(f"seen: expected {n} numbers each")
        return result, card_of(arrays, path, REMEDY)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error
    except (KeyError, ValueError, IndexError, OverflowError) as error:
        why = cut(str(error) if isinstance(error, InputError) else repr(error))
        raise FileFormatError(f"{path}: holds damaged parameters, or another version's: {why}; {REMEDY}") from error
