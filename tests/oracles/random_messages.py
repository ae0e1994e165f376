"""Messages with random content, of every type."""

from typing import Any

import numpy as np

from catenary.crtk.message import message_class
from catenary.recording.messages import MESSAGES, NUMBERS, Field, fields


def random_message(name: str, rng: np.random.Generator) -> Any:
    """A message of that type; sequences have up to four elements."""
    return message_class(name)(*(_value(field, rng) for field in fields(name)))


def _value(field: Field, rng: np.random.Generator) -> Any:
    if field.length is not None and field.type not in NUMBERS:
        single = field._replace(length=None)
        return tuple(_value(single, rng) for _ in range(field.length or rng.integers(5)))
    if field.type in NUMBERS:
        kind = np.dtype(NUMBERS[field.type])
        count = 1 if field.length is None else field.length or int(rng.integers(5))
        if field.type == "bool":
            array = rng.integers(0, 2, count).astype(kind)
        elif kind.kind == "f":
            array = rng.normal(size=count).astype(kind)
        else:
            limits = np.iinfo(kind)
            array = rng.integers(limits.min, limits.max, count, dtype=kind.newbyteorder("="), endpoint=True)
        if field.length is not None:
            return array
        return bool(array[0]) if field.type == "bool" else array[0].item()
    if field.type == "time":
        return int(rng.integers(2**31)) * 10**9 + int(rng.integers(10**9))
    if field.type == "duration":
        return int(rng.integers(-(2**31), 2**31)) * 10**9 + int(rng.integers(10**9))
    if field.type in MESSAGES:
        return random_message(field.type, rng)
    return "".join(rng.choice(list("aß水 /_0"), int(rng.integers(6))))


def assert_same(got: Any, expected: Any) -> None:
    """Compare two messages field by field."""
    assert type(got) is type(expected)
    if isinstance(expected, np.ndarray):
        np.testing.assert_array_equal(got, expected)
        assert got.dtype == expected.dtype
    elif isinstance(expected, tuple):
        assert len(got) == len(expected)
        for one, other in zip(got, expected, strict=True):
            assert_same(one, other)
    else:
        assert got == expected
