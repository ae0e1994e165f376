import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.crtk.frames import KINDS, STAMP, Frame, Numbers
from catenary.crtk.sheet import Sheet
from catenary.errors import InputError

NOW = 1_700_000_000_123_456_789  # [ns]
LETTER = {"<f8": "d", "<f4": "f", "<i4": "i"}
values = st.floats(-1e9, 1e9)


@settings(deadline=None)  # it is compiled within the first example
@given(
    st.lists(
        st.tuples(
            st.sampled_from(KINDS), st.integers(16, 31), st.floats(-2.0, 2.0), st.lists(values, max_size=5)
        ),
        max_size=6,
    )
)
def test_numbers_lie_where_struct_puts_them_wherever_that_is(parts):
    """One run of numbers a frame, at any byte, of any type: struct is the oracle."""
    numbers = np.array([value for *_, run in parts for value in run])
    frames, expected, source = [], [], 0
    for kind, place, factor, run in parts:
        blank = bytearray(80)
        frames.append(Frame(bytes(blank), (Numbers(place, kind, source, len(run), factor),)))
        source += len(run)
        products = [factor * value for value in run]
        struct.pack_into(
            f"<{len(run)}{LETTER[kind]}", blank, place, *(map(int, products) if kind == "<i4" else products)
        )
        struct.pack_into("<II", blank, STAMP.start, *divmod(NOW, 10**9))
        expected.append(bytes(blank))
    sheet = Sheet(frames, len(numbers))
    sheet.numbers[:] = numbers
    sheet.write(NOW)
    assert [bytes(sheet.frame(k)) for k in range(len(frames))] == expected


def test_numbers_may_be_sums_of_two_before_they_are_scaled():
    sheet = Sheet([Frame(bytes(40), (Numbers(16, "<f8", 0, 2, 0.5, plus=2),))], 4)
    sheet.numbers[:] = 0.1, -0.7, 0.3, 2.0
    sheet.write(NOW)
    assert struct.unpack_from("<2d", sheet.frame(0), 16) == ((0.1 + 0.3) * 0.5, (-0.7 + 2.0) * 0.5)


def test_another_content_takes_the_place_and_its_own_length():
    sheet = Sheet([Frame(b"a" * 20, room=24), Frame(b"b" * 20)], 0)
    sheet.replace(0, b"c" * 24)
    assert bytes(sheet.frame(0)) == b"c" * 24
    sheet.replace(0, b"d" * 17)
    assert bytes(sheet.frame(0)) == b"d" * 17
    assert bytes(sheet.frame(1)) == b"b" * 20


def test_a_content_that_is_longer_than_its_room_is_refused():
    with pytest.raises(InputError, match="frame 0: 21 bytes, room for 20"):
        Sheet([Frame(b"a" * 20)], 0).replace(0, b"c" * 21)


@pytest.mark.parametrize("part", [(16, 0, 3), (16, -1, 1), (13, 0, 1)])
def test_numbers_outside_of_a_frame_or_that_there_are_not_are_refused(part):
    place, source, many = part
    with pytest.raises(InputError, match="frame 0"):
        Sheet([Frame(bytes(20), (Numbers(place, "<f8", source, many),))], 2)
