import subprocess
from pathlib import Path

import pytest

from catenary.recording.hashing import sha256_of


def test_sha256_is_the_published_one_of_abc(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    # FIPS 180-2, appendix B.1
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of(tmp_path / "abc") == expected


@pytest.mark.parametrize("size", [0, 1, 2**20 + 1])
def test_sha256_agrees_with_coreutils(tmp_path: Path, size: int) -> None:
    path = tmp_path / "bytes"
    path.write_bytes(bytes(i % 251 for i in range(size)))
    printed = subprocess.run(["sha256sum", str(path)], capture_output=True, text=True, check=True).stdout
    assert sha256_of(path) == printed.split()[0]
