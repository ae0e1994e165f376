import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from catenary.recording.bag_chunks import CONNECTION, DATA, END, KIND, TIME, Block, chunk_records, gather


def record(fields: list[tuple[bytes, bytes]], data: bytes) -> bytes:
    """As the format has it: lengths before the header, its fields and the data [wiki.ros.org/Bags/Format/2.0]."""
    parts = [key + b"=" + value for key, value in fields]
    header = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def message(connection: int, stamp: int, data: bytes, order: tuple[int, ...] = (0, 1, 2)) -> bytes:
    fields = [
        (b"op", b"\x02"),
        (b"conn", struct.pack("<I", connection)),
        (b"time", struct.pack("<II", *divmod(stamp, 10**9))),
    ]
    return record([fields[i] for i in order], data)


@pytest.mark.slow
@settings(deadline=None)  # compiled on first use
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**32 * 10**9 - 1),
            st.binary(max_size=40),
            st.permutations((0, 1, 2)),
        ),
        max_size=12,
    ),
    st.binary(max_size=5),
)
def test_records_are_found_whatever_the_order_of_their_fields(messages, rest):
    whole = b"".join(message(c, t, d, tuple(order)) for c, t, d, order in messages)
    records = chunk_records(whole + rest[:3])  # what is cut off is left
    assert len(records) == len(messages)
    assert_array_equal(records[:, KIND], 2)
    assert records[:, CONNECTION].tolist() == [c for c, _, _, _ in messages]
    assert records[:, TIME].tolist() == [t for _, t, _, _ in messages]
    assert list(gather(whole, records)) == [d for _, _, d, _ in messages]


@pytest.mark.parametrize("cut", range(1, 40))
def test_a_chunk_that_is_cut_off_gives_its_whole_records(cut):
    one = message(0, 1, b"abc")
    assert len(chunk_records((one + one)[:-cut])) == (1 if cut <= len(one) else 0)


def test_a_header_that_makes_no_sense_is_marked():
    broken = struct.pack("<I", 8) + struct.pack("<I", 2**31) + b"op=\x02" + struct.pack("<I", 0)
    assert chunk_records(broken)[0, KIND] == -1


def test_other_fields_are_passed_over():
    one = record([(b"compression", b"none"), (b"op", b"\x07"), (b"conn", b"\x01\0\0\0")], b"x")
    ((kind, connection, _, _, data, end),) = chunk_records(one).tolist()
    assert (kind, connection, one[data:end]) == (7, 1, b"x")
    assert (DATA, END) == (4, 5)


def test_blocks_are_joined_in_order():
    blocks = [Block(np.frombuffer(b"abc", np.uint8), np.array([1, 2])), Block(np.zeros(0, np.uint8), np.array([0]))]
    joined = Block.joined(blocks)
    assert list(joined) == [b"a", b"bc", b""]
