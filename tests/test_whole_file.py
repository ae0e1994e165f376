import pytest

from catenary.errors import FileFormatError
from catenary.whole_file import write_whole


def test_a_file_is_replaced_whole(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"long before")
    write_whole(path, b"now")
    assert path.read_bytes() == b"now"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_file_that_cannot_be_written_leaves_what_was_there(tmp_path):
    path = tmp_path / "folder"
    path.mkdir()
    with pytest.raises(FileFormatError, match="cannot be written"):
        write_whole(path, b"now")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
