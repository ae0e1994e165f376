import itertools
import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.devices.line_protocol import (
    LONGEST,
    BoardSample,
    ChecksumError,
    Hello,
    LineSplitter,
    checksum,
    parse_line,
)
from catenary.errors import InputError

NUMBER = st.floats(-100.0, 100.0)


def framed(body):
    return f"${body}*{checksum(body)}"


def sample_line(number, micros, force=(0.0, 0.0, 9.8), rate=None):
    return framed(f"CATAC,{number},{micros}," + ",".join(f"{v:.5f}" for v in (*force, *(rate or ()))))


def test_the_checksum_is_that_of_nmea():
    # the sentence that NMEA 0183's descriptions show
    assert checksum("GPGLL,5300.97914,N,00259.98174,E,125926,A") == "28"


@given(
    number=st.integers(0, 65535),
    micros=st.integers(0, 2**32 - 1),
    force=st.tuples(NUMBER, NUMBER, NUMBER),
    rate=st.none() | st.tuples(NUMBER, NUMBER, NUMBER),
)
def test_a_sample_is_read_as_it_was_written(number, micros, force, rate):
    read = parse_line(sample_line(number, micros, force, rate))
    assert isinstance(read, BoardSample)
    assert (read.number, read.micros) == (number, micros)
    assert read.acceleration == pytest.approx(force, abs=1e-5)  # five decimals
    assert read.rate == (None if rate is None else pytest.approx(rate, abs=1e-5))


def test_a_hello_is_read_as_it_was_written():
    hello = Hello("MPU-6050", "m/s2", 19.6, "rad/s", 4.36, 100.0)
    assert parse_line(framed("CATHI,1," + ",".join(map(str, hello)))) == hello


@given(position=st.integers(0, 60), bit=st.integers(0, 6))
def test_any_bit_that_turns_is_noticed(position, bit):
    line = sample_line(17, 123456, (0.1, -0.2, 9.8))
    position %= len(line)
    damaged = line[:position] + chr(ord(line[position]) ^ (1 << bit)) + line[position + 1 :]
    if damaged.upper() != line:  # the checksum's digits may be of either case
        with pytest.raises(ChecksumError):
            parse_line(damaged)


@pytest.mark.parametrize(
    "line", ["", "$", "hello", "$CATAC,1,2,3,4,5", "$CATAC,1,2,3*", "CATAC*00", "*", "$*00*"]
)
def test_noise_is_refused_as_damaged(line):
    with pytest.raises(ChecksumError):
        parse_line(line)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("CATAC,1,2,3,4", "CATAC with 4 fields"),
        ("CATAC,1,2,3,4,5,6", "CATAC with 6 fields"),
        ("CATAC,1,x,3,4,5", "invalid literal"),
        ("CATAC,1,2,3,4,up", "could not convert"),
        ("CATXX,1,2,3,4,5", "CATXX with 5 fields"),
        ("CATHI,2,s,m/s2,19,none,0,100", "expected version 1"),
        ("CATHI,1,s,furlong,19,none,0,100", 'unit "furlong": expected one of m/s2, cm/s2, g, mg'),
        ("CATHI,1,s,g,2,rpm,0,100", 'rate unit "rpm": expected one of rad/s, deg/s, none'),
        ("CATHI,1,s,g,0,none,0,100", "expected positive"),
    ],
)
def test_whole_lines_of_wrong_content_are_refused_in_words(body, said):
    with pytest.raises(InputError, match=said) as caught:
        parse_line(framed(body))
    assert not isinstance(caught.value, ChecksumError)


def test_numbers_that_are_none_pass_for_the_estimator_to_name():
    read = parse_line(framed("CATAC,1,2,nan,inf,9.8"))
    assert math.isnan(read.acceleration[0])


@given(cuts=st.lists(st.integers(0, 60), max_size=6))
def test_lines_come_out_whole_however_their_bytes_come_in(cuts):
    text = "".join(f"{sample_line(k, k)}\r\n" for k in range(2)).encode()
    places = sorted({0, len(text), *(min(c, len(text)) for c in cuts)})
    splitter, lines = LineSplitter(), []
    for a, b in itertools.pairwise(places):
        lines += splitter.feed(text[a:b])
    assert [parse_line(line).number for line in lines] == [0, 1]


def test_noise_without_an_end_is_thrown_away():
    splitter = LineSplitter()
    assert len(splitter.feed(b"\xff" * (LONGEST + 1))) == 1
    assert len(splitter.feed(f"\n{sample_line(1, 1)}\r\n".encode())) == 1


def test_the_lines_on_the_page_are_lines_of_the_protocol():
    page = (Path(__file__).parents[2] / "docs" / "devices.md").read_text()
    read = [parse_line(line) for line in re.findall(r"^\$CAT.*$", page, re.MULTILINE)]
    assert [type(line) for line in read] == [Hello, BoardSample]
