"""The records of a chunk of a ROS 1 bag or of MCAP, found and gathered by compiled code: no Python object per message.

[wiki.ros.org/Bags/Format/2.0, mcap.dev/spec]
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.kernels.compiled import compiled

KIND, CONNECTION, TIME, HEADER, DATA, END = range(6)  # columns of a chunk's records
_AT_ONCE = 8192
Records = NDArray[np.int64]


class Block:
    """N messages one behind the other in one piece of memory."""

    def __init__(self, data: NDArray[np.uint8], lengths: NDArray[np.int64]) -> None:
        self.data, self.lengths = data, lengths
        self._ends = np.cumsum(lengths)

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.lengths)

    def __getitem__(self, index: int) -> bytes:
        """Return the bytes of a message."""
        end = self._ends[index]
        return self.data[end - self.lengths[index] : end].tobytes()

    @classmethod
    def of(cls, messages: Sequence[bytes]) -> "Block":
        """Return a block of these messages."""
        lengths = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
        return cls(np.frombuffer(b"".join(messages), dtype=np.uint8), lengths)

    @classmethod
    def joined(cls, blocks: Sequence["Block"]) -> "Block":
        """Return one block of all messages of several."""
        if len(blocks) == 1:
            return blocks[0]
        every = [cls.of([]), *blocks]
        return cls(np.concatenate([block.data for block in every]), np.concatenate([block.lengths for block in every]))


def chunk_records(chunk: bytes) -> Records:
    """Return the records of an unpacked chunk up to its last whole one, (N, 6).

    Columns: op, connection, time [ns], where header, data and record begin, begin and end. Op is -1 of a record whose
    header is damaged.
    """
    data = np.frombuffer(chunk, dtype=np.uint8)
    records = np.empty((len(data) // 8, 6), dtype=np.int64)
    return records[: _walk(data, records)]


def mcap_chunk_records(chunk: bytes) -> Records:
    """Return the records of a chunk of MCAP up to its last whole one, (N, 6); columns as of `chunk_records`.

    Of messages, connection is their channel; of others they tell but the kind, and where it begins and ends.
    """
    data = np.frombuffer(chunk, dtype=np.uint8)
    records = np.empty((len(data) // 9, 6), dtype=np.int64)
    return records[: _walk_mcap(data, records)]


def rows_of(records: Records) -> Iterator[list[int]]:
    """Yield records as Python's numbers, some thousands in memory at a time."""
    for begin in range(0, len(records), _AT_ONCE):
        yield from records[begin : begin + _AT_ONCE].tolist()


def gather(chunk: bytes, records: Records) -> Block:
    """Return the messages of a chunk's records."""
    lengths = records[:, END] - records[:, DATA]
    out = np.empty(int(lengths.sum()), dtype=np.uint8)
    _copy(np.frombuffer(chunk, dtype=np.uint8), records, out)
    return Block(out, lengths)


@compiled
def _u32(data: NDArray[np.uint8], position: int) -> Any:
    return (
        np.int64(data[position])
        | np.int64(data[position + 1]) << 8
        | np.int64(data[position + 2]) << 16
        | np.int64(data[position + 3]) << 24
    )


@compiled
def _walk(data: NDArray[np.uint8], records: Records) -> int:
    size, position, count = len(data), 0, 0
    while position + 4 <= size:
        header = position + 4
        middle = header + _u32(data, position)
        if middle + 4 > size:
            break
        end = middle + 4 + _u32(data, middle)
        if end > size:
            break
        row = records[count]
        row[0], row[1], row[2], row[3], row[4], row[5] = 0, -1, -1, header, middle + 4, end
        field = header
        while field < middle:
            if field + 4 > middle:
                row[0] = -1
                break
            begin = field + 4
            stop = begin + _u32(data, field)
            if stop > middle:
                row[0] = -1
                break
            length = stop - begin
            first = data[begin] if length else np.uint8(0)
            # op=?, conn=????, time=????????: told apart by their first letter and length
            if length == 4 and first == 111 and data[begin + 2] == 61:
                row[0] = data[begin + 3]
            elif length == 9 and first == 99 and data[begin + 4] == 61:
                row[1] = _u32(data, begin + 5)
            elif length == 13 and first == 116 and data[begin + 4] == 61:
                row[2] = _u32(data, begin + 5) * 1_000_000_000 + _u32(data, begin + 9)
            field = stop
        count += 1
        position = end
    return count


@compiled
def _walk_mcap(data: NDArray[np.uint8], records: Records) -> int:
    size, position, count = len(data), 0, 0
    while position + 9 <= size:
        begin = position + 9
        length = _u32(data, position + 1) | _u32(data, position + 5) << 32
        if length < 0 or length > size - begin:
            break
        row = records[count]
        row[0], row[1], row[2], row[3], row[4], row[5] = data[position], -1, -1, begin, begin, begin + length
        if row[0] == 5:
            if length < 22:
                row[0] = -1
            else:
                row[1] = np.int64(data[begin]) | np.int64(data[begin + 1]) << 8
                row[2] = _u32(data, begin + 6) | _u32(data, begin + 10) << 32
                row[4] = begin + 22
        count += 1
        position = begin + length
    return count


@compiled
def _copy(data: NDArray[np.uint8], records: Records, out: NDArray[np.uint8]) -> None:
    place = 0
    for i in range(len(records)):
        length = records[i, 5] - records[i, 4]
        out[place : place + length] = data[records[i, 4] : records[i, 5]]
        place += length
