"""The parts of a bag's records, read within bounds: lengths, headers, chunks.

[wiki.ros.org/Bags/Format/2.0, mcap.dev/spec]
"""

from struct import Struct, error
from typing import BinaryIO, Literal, cast

from catenary.archives import unpacked

# what reading damaged bytes raises
DAMAGE = (error, LookupError, ValueError, OSError, EOFError, RuntimeError, ArithmeticError, MemoryError)
MAX_HEADER = 2**20  # [B] of a record's header, or of a connection's
_U32, _U64 = Struct("<I"), Struct("<Q")


def header_fields(data: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header in a ROS 1 bag."""
    if len(data) > MAX_HEADER:
        raise ValueError(f"a header of {len(data)} bytes, expected {MAX_HEADER} at most")
    values, position = {}, 0
    while position < len(data):
        length = _U32.unpack_from(data, position)[0]
        end = position + 4 + length
        if end > len(data):
            raise ValueError(f"a field of {length} bytes, its header ends after {len(data) - position - 4}")
        key, _, value = data[position + 4 : end].partition(b"=")
        values[key] = value
        position = end
    return values


def field_of(values: dict[bytes, bytes], key: bytes, length: int | None = None) -> bytes:
    """Return a field of a header."""
    found = values.get(key)
    if found is None:
        raise ValueError(f"a header without {key.decode()}")
    if length not in (None, len(found)):
        raise ValueError(f"{key.decode()} has {len(found)} bytes, expected {length}")
    return found


def sized(file: BinaryIO, size: int) -> bytes | None:
    """Bytes behind their length, or None where the file ends first."""
    if file.tell() + 4 > size:
        return None
    length = _U32.unpack(file.read(4))[0]
    return file.read(length) if file.tell() + length <= size else None  # else what is there can still be read


def bag_record(file: BinaryIO, size: int) -> tuple[dict[bytes, bytes], bytes | None]:
    """Return header and data of a record: no header where it is damaged, no data where the file ends first."""
    head = sized(file, size)
    data = None if head is None else sized(file, size)
    try:
        return ({} if head is None else header_fields(head)), data
    except DAMAGE:
        return {}, data


def chunk_of(values: dict[bytes, bytes], data: bytes, left: int) -> bytes:
    """Return a chunk of a ROS 1 bag, unpacked to the size that its header states."""
    kind = field_of(values, b"compression")
    if kind == b"none":
        return data
    stated = _U32.unpack(field_of(values, b"size", 4))[0]
    if kind not in (b"bz2", b"lz4"):
        raise ValueError(f"unknown compression {kind.decode(errors='replace')}")
    if stated > left:
        raise ValueError(f"a chunk would unpack to {stated} bytes; {left} are left of what is read")
    chunk = unpacked(data, cast("Literal['bz2', 'lz4']", kind.decode()), stated)
    if len(chunk) != stated:
        raise ValueError(f"a chunk unpacks to {len(chunk)} bytes, and states {stated}")
    return chunk


def text_at(data: bytes, position: int) -> tuple[str, int]:
    """Return the text of MCAP that stands there behind its length, and where it ends."""
    length = _U32.unpack_from(data, position)[0]
    end = position + 4 + length
    if end > len(data):
        raise ValueError(f"a text of {length} bytes, its record ends after {len(data) - position - 4}")
    return data[position + 4 : end].decode(), end
