"""Archives with a card inside and a readable copy of it beside them; the card knows the numbers that it is of."""

import hashlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.documents import json_table
from catenary.errors import FileFormatError
from catenary.files import card_path, card_text, damage, written_whole

SEAL = "arrays_sha256"  # in a card: of the arrays that it was written with


def write_with_card(path: Path, arrays: Mapping[str, NDArray[Any]], card: Mapping[str, Any]) -> None:
    """Write arrays and their card, which gets their SHA-256, and a readable copy of it beside them: both or neither."""
    text, buffer = card_text({**card, SEAL: sha256_of_arrays(arrays)}), io.BytesIO()
    np.savez(buffer, allow_pickle=False, card=np.array(text), **arrays)
    with written_whole(card_path(path)) as copy, written_whole(path) as file:
        for each, content in ((file, buffer.getvalue()), (copy, text.encode())):
            each.write(content)
            each.flush()
            if S_ISREG(os.fstat(each.fileno()).st_mode):  # no device or pipe
                os.fsync(each.fileno())  # a full disk is noticed before either appears


def card_of(arrays: Mapping[str, NDArray[Any]], path: Path, remedy: str) -> dict[str, Any]:
    """Return the card that an archive's arrays were written with; it tells damage and slips, not who changes both."""
    card = json_table(str(arrays.get("card")), "card", finite=False)
    if card.get(SEAL) != sha256_of_arrays(arrays):
        why = (
            f"its numbers are not those that its card was written for ({SEAL}): something changed them since"
        )
        raise FileFormatError(damage(path, why, remedy))
    return card


def sha256_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of arrays but the card: names, types, shapes and numbers, however they are packed."""
    hashed = hashlib.sha256()
    for name in sorted(arrays.keys() - {"card"}):
        values = arrays[name]
        hashed.update(f"{name} {values.dtype.str} {values.shape} ".encode() + values.tobytes())
    return hashed.hexdigest()
