"""Damage to bytes by a seed: what disks, transfers, editors and attackers do to a file."""

import random
from collections.abc import Callable, Sequence

SPECIAL = (0, 1, -1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1, 100, 65_535, 2**20, 2**28)
Place = tuple[int, int]  # where an integer stands, and its bytes


def mutant(rng: random.Random, content: bytes, places: Sequence[Place] = ()) -> bytes:
    """Return content with one to three kinds of damage.

    Args:
        rng: Chooses.
        content: Whole.
        places: Where lengths and counts stand in it, little-endian; half of the mutants have others there.
    """
    if places and rng.random() < 0.5:
        damaged = bytearray(content)
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            _replace_integer(rng, damaged, rng.choice(places))
        return bytes(damaged)
    damaged = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        damaged = rng.choice(_KINDS)(rng, damaged)
    return bytes(damaged)


def _replace_integer(rng: random.Random, data: bytearray, place: Place) -> None:
    at, size = place
    now = int.from_bytes(data[at : at + size], "little")
    value = rng.choice((*SPECIAL, now + 1, now - 1, 2 * now, len(data), now ^ (1 << rng.randrange(8 * size))))
    data[at : at + size] = (value % 2 ** (8 * size)).to_bytes(size, "little")


def _block(rng: random.Random, data: bytearray) -> tuple[int, int]:
    length = min(len(data), rng.choice((1, 2, 4, 8, 16, 64, 256, 1024, 4096, 20_000)))
    at = rng.randrange(len(data) - length + 1)
    return at, at + length


def _flip(rng: random.Random, data: bytearray) -> bytearray:
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if data:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return data


def _overwrite(rng: random.Random, data: bytearray) -> bytearray:
    begin, end = _block(rng, data)
    fill = rng.choice((b"\0", b"\xff", None))
    data[begin:end] = rng.randbytes(end - begin) if fill is None else fill * (end - begin)
    return data


def _truncate(rng: random.Random, data: bytearray) -> bytearray:
    return data[: rng.randrange(len(data) + 1)]


def _insert(rng: random.Random, data: bytearray) -> bytearray:
    at = rng.randrange(len(data) + 1)
    data[at:at] = rng.randbytes(rng.choice((1, 4, 100, 5000)))
    return data


def _duplicate(rng: random.Random, data: bytearray) -> bytearray:
    begin, end = _block(rng, data)
    at = rng.randrange(len(data) + 1)
    data[at:at] = data[begin:end] * rng.choice((1, 1, 2, 20))
    return data


def _delete(rng: random.Random, data: bytearray) -> bytearray:
    begin, end = _block(rng, data)
    del data[begin:end]
    return data


def _swap(rng: random.Random, data: bytearray) -> bytearray:
    begin, end = _block(rng, data)
    block = data[begin:end]
    del data[begin:end]
    at = rng.randrange(len(data) + 1)
    data[at:at] = block
    return data


def _integer(rng: random.Random, data: bytearray) -> bytearray:
    size = rng.choice((1, 2, 4, 8))
    if len(data) >= size:
        _replace_integer(rng, data, (rng.randrange(len(data) - size + 1), size))
    return data


_KINDS: tuple[Callable[[random.Random, bytearray], bytearray], ...] = (
    _flip, _overwrite, _truncate, _insert, _duplicate, _delete, _swap, _integer,
)  # fmt: skip


def same_length(rng: random.Random, data: bytes) -> bytes:
    changed = mutant(rng, data) if data else data
    return (changed + data)[: len(data)]
