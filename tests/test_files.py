import json
import math
import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from catenary.errors import FileFormatError
from catenary.files import damage, json_text, sha256_of, write_atomically, written_whole


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


def test_plain_data_come_back_from_json_in_ascii_without_nan() -> None:
    content = {"a": [1, 2.5, "µ\udcff", None, True], "b": {"c": []}}
    assert json.loads(json_text(content)) == content
    assert json_text(content).isascii()
    assert json.loads(json_text({"a": (math.nan, [math.inf, -math.inf])})) == {"a": [None, [None, None]]}


def test_a_planted_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_bytes(b"mine")
    link, dangling = tmp_path / "link", tmp_path / "dangling"
    link.symlink_to(precious)
    dangling.symlink_to(tmp_path / "nowhere")
    (tmp_path / ".link.partial").symlink_to(precious)  # under the name that a partial file had once
    for path in (link, dangling):
        write_atomically(path, b"now")
        assert not path.is_symlink()
        assert path.read_bytes() == b"now"
    assert precious.read_bytes() == b"mine"
    assert not (tmp_path / "nowhere").exists()


def test_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_atomically(pipe, b"now")
    assert os.read(reader, 10) == b"now"
    os.close(reader)
    assert pipe.is_fifo()
    read, write = os.pipe()
    write_atomically(Path(f"/proc/self/fd/{write}"), b"again")  # what /dev/stdout is a link to
    assert os.read(read, 10) == b"again"
    os.close(read)
    os.close(write)


def test_a_file_is_on_the_disk_before_it_has_its_name_and_its_name_before_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, done = tmp_path / "a", []
    fsync, replace = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        done.append("folder" if is_folder else os.fstat(descriptor).st_size)
        fsync(descriptor)

    def renamed(old: Path, new: Path) -> None:
        done.append("rename")
        replace(old, new)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", renamed)
    write_atomically(path, b"now")
    assert done == [3, "rename", "folder"]


def test_an_interrupted_file_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"before")

    def interrupted() -> None:
        with written_whole(path) as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_bytes() == b"before"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_what_may_be_under_way_is_swept_by_age_where_a_file_is_closed_before_it_is_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("catenary.files.OPEN_FILES_CAN_MOVE", False)
    young, old = (tmp_path / f".{digit * 16}.partial" for digit in "ab")
    for path in (young, old):
        path.write_bytes(b"half")
    os.utime(old, (time.time() - 3600.0,) * 2)
    write_atomically(tmp_path / "a", b"now")
    assert {path.name for path in tmp_path.iterdir()} == {"a", young.name}


def test_a_damaged_file_is_named_with_what_makes_it_again(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"")
    assert damage(path, "no JSON", "run it again") == f"{path}: damaged: it is empty; run it again"
    path.write_bytes(b"{")
    assert damage(path, "no JSON", "run it again") == f"{path}: damaged: no JSON; run it again"


HALF = """
import os, signal, sys
from pathlib import Path
from catenary.files import partial_folder, written_whole

folder = Path(sys.argv[1])
with written_whole(folder / "log.parquet") as file, partial_folder(folder) as inside:
    file.write(bytes(10_000))
    file.flush()
    (inside / "half").write_bytes(bytes(100))
    print("written", flush=True)
    sys.stdin.read()
"""


def writing(folder: Path) -> subprocess.Popen[str]:
    """A process that is half through writing."""
    process = subprocess.Popen(
        [sys.executable, "-c", HALF, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "written\n"
    return process


def partial(folder: Path) -> list[Path]:
    return sorted(folder.glob(".*.partial"))


def test_what_a_killed_process_left_is_swept_by_the_next_that_writes_there(tmp_path: Path) -> None:
    process = writing(tmp_path)
    process.kill()
    process.communicate()
    long_ago = time.time() - 3600.0
    for left in partial(tmp_path):
        os.utime(left, (long_ago, long_ago))
    assert len(partial(tmp_path)) == 2
    write_atomically(tmp_path / "another.json", b"{}")
    assert partial(tmp_path) == []


def test_what_a_living_process_writes_is_never_swept(tmp_path: Path) -> None:
    process = writing(tmp_path)
    there = partial(tmp_path)
    long_ago = time.time() - 3600.0
    for one in there:
        os.utime(one, (long_ago, long_ago))
    write_atomically(tmp_path / "another.json", b"{}")
    assert partial(tmp_path) == there
    process.communicate("")
    assert process.returncode == 0
    assert (tmp_path / "log.parquet").stat().st_size == 10_000
    assert partial(tmp_path) == []


def test_what_bears_the_name_of_other_programs_is_not_swept(tmp_path: Path) -> None:
    for name in (".film.mp4.partial", "0123456789abcdef.partial", ".0123.partial"):
        (tmp_path / name).write_bytes(b"theirs")
        os.utime(tmp_path / name, (0.0, 0.0))
    write_atomically(tmp_path / "another.json", b"{}")
    assert len(list(tmp_path.iterdir())) == 4
