import bz2
import io
import zipfile
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pyarrow as pa
import pytest

from catenary.archives import MAX_UNPACKED_BYTES, decompressed, read_array, read_arrays
from catenary.errors import FileFormatError


def written(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    np.savez(
        folder / "log.npz", q_des=rng.normal(size=(5, 6)), q_act=rng.normal(size=(5, 6)), ok=np.ones(5, dtype=bool)
    )
    return folder / "log.npz"


def member(name: str, content: bytes | str) -> bytes:
    """An archive of one file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


def huge() -> bytes:
    """An array that claims more than memory."""
    buffer = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    np.lib.format.write_array_header_1_0(buffer, header)
    return buffer.getvalue()


def saved(values: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, values)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (saved(np.zeros((5, 6))), "cannot be read as an .npz archive"),
        (
            member("q_des.npy", saved(np.array([{"a": 1}], dtype=object))),
            "cannot be read as an .npz archive of plain arrays",
        ),
        (member("q_des", "not an array"), '"q_des" is not an array'),
        (member("q_des.npy", huge()), "cannot be read"),
        (np.random.default_rng(2).bytes(4000), "cannot be read"),
        *[
            (member("q_des.npy", saved(np.zeros(3)).replace(b" ", bracket, 1)), "cannot be read")
            for bracket in (b"(", b"{", b"[")
        ],
    ],
    ids=["one array", "Python objects", "zip of other files", "huge", "random", "(", "{", "["],
)
def test_what_is_no_archive_of_arrays_is_refused(tmp_path: Path, raw: bytes, said: str) -> None:
    (tmp_path / "log.npz").write_bytes(raw)
    with pytest.raises(FileFormatError, match=f"log.npz: .*{said}"):
        read_arrays(tmp_path / "log.npz")


@pytest.mark.parametrize("step", [97, pytest.param(37, marks=pytest.mark.slow)])
def test_truncated_archive_is_refused_wherever_it_ends(tmp_path: Path, step: int) -> None:
    path = written(tmp_path)
    whole = path.read_bytes()
    for end in range(0, len(whole), step):
        path.write_bytes(whole[:end])
        with pytest.raises(FileFormatError, match=r"log.npz: cannot be read"):
            read_arrays(path)


def header(shape: str, descr: str = "'<f8'") -> bytes:
    """An array of no bytes that says this of itself."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


CLAIMS = {
    "more than memory": header(f"({2**40},)"),
    "a gigabyte": header(f"({2**27},)"),
    "overflowing": header(f"({2**62}, {2**62})"),
    "of no bytes each": header(f"({2**40},)", "'<U0'"),
    "of bytes that are not there": header("(5,)"),
    "of true length": header("(True,)"),
    "no rows of very many numbers": header(f"(0, {2**40})"),
    "objects": header("(0,)", "'|O'"),
    "structures": header("(0,)", "[('a', '<f8')]"),
    "arrays of arrays": header("(0,)", "('<f8', (1000000000,))"),
    "deep": header("(" * 200 + ")" * 200),
    "long number": header(f"({'9' * 5000},)"),
    "another version": header("(0,)").replace(b"\x01\x00", b"\x09\x00", 1),
}


@pytest.mark.parametrize("claim", CLAIMS.values(), ids=CLAIMS)
def test_what_an_array_says_of_itself_is_believed_only_after_it_is_checked(tmp_path: Path, claim: bytes) -> None:
    (tmp_path / "x.npz").write_bytes(member("q_des.npy", claim))
    with pytest.raises(FileFormatError, match=r"x.npz: cannot be read as an .npz"):
        read_arrays(tmp_path / "x.npz")
    (tmp_path / "x.npy").write_bytes(claim)
    with pytest.raises(FileFormatError, match=r"x.npy: cannot be read as an .npy"):
        read_array(tmp_path / "x.npy")


@pytest.mark.parametrize("count", [1, 20])
def test_an_archive_that_would_unpack_to_gigabytes_is_refused_before_it_does(tmp_path: Path, count: int) -> None:
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for i in range(count):
            archive.writestr(f"{i}.npy", b"x")
    raw = bytearray(path.read_bytes())  # its directory claims more, as a bomb of overlapping files does
    place = -1
    for _ in range(count):
        place = raw.index(b"PK\x01\x02", place + 1)
        raw[place + 24 : place + 28] = (2 * MAX_UNPACKED_BYTES // count).to_bytes(4, "little")
    path.write_bytes(raw)
    with pytest.raises(FileFormatError, match="would unpack to"):
        read_arrays(path)


def test_an_archive_of_small_numbers_counts_as_what_they_become(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("ok.npy", header("(20000000,)", "'|u1'") + bytes(20_000_000))
    with pytest.raises(FileFormatError, match="more than"):
        read_arrays(path)


def test_archives_of_very_many_or_twofold_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(1001):
            archive.writestr(f"{i}.npy", b"")
    with pytest.raises(FileFormatError, match="1001 files"):
        read_arrays(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", b"")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("a.npy", b"")
    with pytest.raises(FileFormatError, match="same name"):
        read_arrays(path)


PACK = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": lambda data: pa.compress(data, "zstd", asbytes=True)}


@pytest.mark.parametrize("kind", PACK)
def test_packed_bytes_are_unpacked_no_further_than_allowed(kind: Any) -> None:
    content = bytes(100_000)
    packed = PACK[kind](content)
    assert decompressed(packed, kind, 100_000) == content
    for wrong in (packed[:-6], b"x" * 100):
        with pytest.raises(ValueError, match="cannot be unpacked"):
            decompressed(wrong, kind, 100_000)
    with pytest.raises(ValueError, match="more than 99999 bytes"):
        decompressed(packed, kind, 99_999)
