"""JSON, TOML and XML within bounds: what is refused, and that the file and the place are named."""

import contextlib
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.bounded_parsers import (
    MAX_LEVELS,
    MAX_TOML_BYTES,
    json_table,
    json_value,
    plain_number,
    read_bounded,
    shortened,
    toml_table,
    xml_root_tag,
    xml_tree,
)
from catenary.errors import CatenaryError, FileFormatError


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1 column 1"),
        ('{"a": 1,\n "b": }', "line 2 column 7"),
        ('{"a": 1, "a": 2}', "'a' is twice"),
        ('{"a": NaN}', "holds NaN"),
        ("[1,\n -Infinity]", "line 2: holds -Infinity"),
        ("[1e999]", "1e999"),
        ("[1,\n" + "7" * 5_000 + "]", "4300 digits"),
        ("[" + "7" * 50 + "]", "less than 2^128"),
        ("[" * (MAX_LEVELS + 1) + "]" * (MAX_LEVELS + 1), "nested more than 64"),
        ("[" * 1_000_000, "nested more than 64"),
        ('{"a":' * 500_000, "nested more than 64"),
        ('["\\ud800"]', "surrogates not allowed"),
        (b"\xff\xfe[\0]\0", "UTF-16, expected UTF-8"),
        (b'["\xff"]', "byte 2: is no UTF-8"),
        ("[" + "0," * 5_000_000 + "0]", "longer than"),
    ],
)
def test_json_that_is_refused_names_file_place_and_reason(text, said):
    with pytest.raises(FileFormatError, match=r"^a\.json: ") as error:
        json_value(text, "a.json")
    assert said in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = ", "at end of document"),
        ("a = 1\na = 2", "overwrite"),
        ("a = [\n" + "7" * 5_000 + "]", "4300 digits"),
        ("a = 0x" + "f" * 5_000, "huge integer"),
        ("a = 1e999", "line 1: number 1e999"),
        ("a = " + "[" * 200_000, "nested more than 64"),
        ("a" + ".a" * 250_000 + " = 1", "nested more than 64"),
        ("a" + " . 'a b'" * 50_000 + " = 1", "nested more than 64"),
        ("[" + '"a".' * 100_000 + "a]", "nested more than 64"),
        ("a = " + "{a=" * 500 + "1" + "}" * 500, "nested more than 64"),
        ("a = 2020-13-45", "line 1"),
        ("a = 1\n" * MAX_TOML_BYTES, "longer than"),
        (b"a = '\xff'", "byte 5: is no UTF-8"),
    ],
)
def test_toml_that_is_refused_names_file_place_and_reason(text, said):
    with pytest.raises(FileFormatError, match=r"^a\.toml: ") as error:
        toml_table(text, "a.toml")
    assert said in str(error.value)
    assert len(str(error.value)) < 500


BOMB = "<!DOCTYPE a [<!ENTITY b0 'x'>" + "".join(f"<!ENTITY b{i + 1} '{f'&b{i};' * 10}'>" for i in range(9))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no element found"),
        ("<a><b></a>", "line 1"),
        (f"{BOMB}]><a>&b9;</a>", "entity 'b0'"),
        ("<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>\n<a>&x;</a>", "entity 'x'"),
        ("<!DOCTYPE a SYSTEM 'http://localhost/a.dtd'><a>&x;</a>", "entity 'x'"),
        ("<!DOCTYPE a [<!ENTITY % x SYSTEM 'file:///etc/passwd'> %x;]><a/>", "entity 'x'"),
        ("<a>&x;</a>", "undefined entity"),
        ("<a>" + "<b/>" * 300_000, "more than 100000 elements"),
        ('<?xml version="1.0" encoding="klingon"?><a/>', "klingon"),
        ("<a>\ud800</a>", "cannot be read as XML"),
    ],
)
def test_xml_that_is_refused_names_file_and_reason(text, said):
    raw = text if "\ud800" in text else text.encode()
    with pytest.raises(FileFormatError, match=r"^a\.xml: ") as error:
        xml_tree(raw, "a.xml")
    assert said in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.parametrize("text", ["1_000", "1e1_0", "\u0661", "\uff11\uff12", "\u00b2", "", "0x10"])
def test_what_xml_has_for_no_number_is_none(text):
    with pytest.raises(ValueError):
        plain_number(text)


@pytest.mark.parametrize("text", ["1", "-1.5", "+.5", "5.", "1e-3", "1E+3", " 2 ", "INF", "-INF"])
def test_what_xml_has_for_a_number_is_one(text):
    assert plain_number(text) == float(text)


def test_what_others_read_is_read_alike():
    assert json_value('{"a": [1, -0.5e3, true, null, "\\u00e9\\ud83d\\ude00"], "b": {}}', "f") == {
        "a": [1, -500.0, True, None, "é😀"],
        "b": {},
    }
    assert json_value(b'\xef\xbb\xbf{"a": 1}', "f") == {"a": 1}
    assert json_value("[Infinity, -Infinity]", "f", finite=False) == [float("inf"), float("-inf")]
    assert json_value("[" * MAX_LEVELS + "]" * MAX_LEVELS, "f") is not None
    assert toml_table(b"\xef\xbb\xbfa = 1\nb.c = [1_000.5, inf]", "f") == {"a": 1, "b": {"c": [1000.5, float("inf")]}}
    with pytest.raises(FileFormatError, match="holds 3, expected a table"):
        json_table("3", "f")


def test_xml_is_read_as_elementtree_reads_it():
    text = '<?xml version="1.0" encoding="latin-1"?><a x="1">é&amp;<!-- c --><b y="2">t</b>u</a>'
    ours, theirs = (read(text.encode("latin-1")) for read in (lambda t: xml_tree(t, "f"), ElementTree.fromstring))
    assert ElementTree.tostring(ours) == ElementTree.tostring(theirs)
    assert xml_root_tag(b"<a/>", "f") == "a"
    assert xml_root_tag(b"<a><b -- what only MuJoCo reads", "f") == "a"


def test_names_in_xml_keep_their_prefixes_which_need_no_declaration():
    root = xml_tree('<a xmlns="u" xmlns:n="v" m:x="1"><n:b/><m:c/></a>', "f")
    assert [element.tag for element in root.iter()] == ["a", "n:b", "m:c"]
    assert root.attrib == {"xmlns": "u", "xmlns:n": "v", "m:x": "1"}
    assert xml_root_tag('<a xmlns="u"/>', "f") == "a"


def test_files_are_read_up_to_their_bound(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"
    with pytest.raises(FileFormatError, match="longer than 4 bytes"):
        read_bounded(path, 4)
    for name, said in (
        ("b", "no such file"),
        (".", "cannot be read"),
        ("a\0", "cannot be read"),
        ("b" * 300, "cannot"),
    ):
        with pytest.raises(FileFormatError, match=said):
            read_bounded(tmp_path / name, 5)


def test_errors_repeat_little_of_a_value():
    assert shortened("a" * 10**6).endswith("(1000002 characters)")
    assert shortened(10**5000) == "a huge integer"


@given(st.text(alphabet='[]{}",:.0123456789eE+-\\u ntf#=\n\'"a', max_size=60))
def test_any_text_is_read_or_refused_by_a_catenary_error(text):
    for read in (json_value, toml_table, xml_tree):
        with contextlib.suppress(CatenaryError):
            read(text, "f")
