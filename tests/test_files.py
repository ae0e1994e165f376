import json
import math
from pathlib import Path

import pytest

from catenary.errors import FileFormatError
from catenary.files import json_text, sha256_of, write_atomically


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"long before")
    write_atomically(path, b"now")
    assert path.read_bytes() == b"now"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_file_that_cannot_be_written_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "folder"
    path.mkdir()
    with pytest.raises(FileFormatError, match="cannot be written"):
        write_atomically(path, b"now")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize(
    ("content", "published"),  # FIPS 180-2, appendix B: one block, none, a million letters
    [
        (b"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"),
        (b"", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"),
        (b"a" * 1_000_000, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"),
    ],
)
def test_sha256_is_the_published_one(tmp_path: Path, content: bytes, published: str) -> None:
    (tmp_path / "file").write_bytes(content)
    assert sha256_of(tmp_path / "file") == published


def test_plain_data_come_back_from_json() -> None:
    content = {"a": [1, 2.5, "µ", None, True], "b": {"c": []}}
    assert json.loads(json_text(content)) == content


def test_nan_and_infinity_are_null_in_json() -> None:
    assert json.loads(json_text({"a": (math.nan, [math.inf, -math.inf])})) == {"a": [None, [None, None]]}


def test_json_is_ascii() -> None:
    assert json_text("µ\udcff").isascii()
