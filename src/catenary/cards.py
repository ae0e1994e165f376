"""Archives with a card inside and a readable copy of it beside them; the card knows the numbers that it is of."""

import hashlib
import io
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from stat import S_ISREG
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.bounded_parsers import json_table
from catenary.errors import FileFormatError
from catenary.files import card_path, card_text, damage, written_whole

_SEAL = "arrays_sha256"  # in a card: of the arrays that it was written with


class Stored:
    """How an array of a dataclass stands in an archive: by its name in the plain data, with its numbers beside them."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic import PlainValidator, ValidationInfo

        def read(name: Any, info: ValidationInfo) -> NDArray[Any]:
            arrays: Mapping[str, NDArray[Any]] = info.context or {}
            if not isinstance(name, str) or name not in arrays:
                raise ValueError("expected the name of an array in the archive")
            return arrays[name]

        return handler.generate_schema(Annotated[Any, PlainValidator(read)])


StoredFloats = Annotated[Floats, Stored()]
StoredIntegers = Annotated[NDArray[np.int64], Stored()]


def stored(record: Any, arrays: dict[str, NDArray[Any]], name: str = "") -> Any:
    """Return a dataclass as plain data, which `parse_settings` reads back with the arrays as its context.

    Args:
        record: A dataclass, and what its fields hold: mappings, lists, arrays, plain data.
        arrays: Filled with the arrays of the record, by their dotted field names.
        name: Dotted field name of the record itself.
    """
    if isinstance(record, np.ndarray):
        arrays[name] = record
        return name
    if is_dataclass(record):
        record = {field.name: getattr(record, field.name) for field in fields(record)}
    if isinstance(record, Mapping):
        return {key: stored(value, arrays, f"{name}.{key}".lstrip(".")) for key, value in record.items()}
    if isinstance(record, list | tuple):
        return [stored(value, arrays, f"{name}.{k}") for k, value in enumerate(record)]
    return record


def write_with_card(path: Path, arrays: Mapping[str, NDArray[Any]], card: Mapping[str, Any]) -> None:
    """Write an archive of arrays, and beside it a readable copy of its card: both or neither.

    Args:
        path: Archive (.npz); the copy's name is `card_path` of it.
        card: Description; the SHA-256 of the arrays is added.
    """
    text, buffer = card_text({**card, _SEAL: sha256_of_arrays(arrays)}), io.BytesIO()
    np.savez(buffer, allow_pickle=False, card=np.array(text), **arrays)
    with written_whole(card_path(path)) as copy, written_whole(path) as file:
        for each, content in ((file, buffer.getvalue()), (copy, text.encode())):
            each.write(content)
            each.flush()
            if S_ISREG(os.fstat(each.fileno()).st_mode):  # no device or pipe
                os.fsync(each.fileno())  # a full disk is noticed before either appears


def card_of(arrays: Mapping[str, NDArray[Any]], path: Path, remedy: str) -> dict[str, Any]:
    """Return the card of an archive, checked against damage, not forgery; FileFormatError where it does not fit.

    Args:
        arrays: Arrays of the archive by name, the card's text among them.
        path: The archive, for messages.
        remedy: How such a file is made again.
    """
    card = json_table(str(arrays.get("card")), "card", finite=False)
    if card.get(_SEAL) != sha256_of_arrays(arrays):
        why = f"its numbers are not those that its card was written for ({_SEAL}): something changed them since"
        raise FileFormatError(damage(path, why, remedy))
    return card


def sha256_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of arrays but the card: names, types, shapes and numbers, however they are packed."""
    hashed = hashlib.sha256()
    for name in sorted(arrays.keys() - {"card"}):
        values = arrays[name]
        hashed.update(f"{name} {values.dtype.str} {values.shape} ".encode() + values.tobytes())
    return hashed.hexdigest()
