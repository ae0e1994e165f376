"""What an attacker, a crash or an odd umask may leave in the cache, and what becomes of it."""

import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest

from catenary.kernels import cache
from catenary.kernels.cache import cache_folder, load_module

SOURCE = "@compiled\ndef one(x):\n    return x + 1.0\n"
EVIL = b"raise SystemExit('foreign code ran')\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of one's own, with numba's files beside the kernels; nothing of it stays in this process."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    yield tmp_path / "cache" / "kernels"
    for name in [name for name in sys.modules if name.startswith("_catenary_kernel_")]:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


def again(folder: Path):
    """Load as another process would; give the module and its file."""
    for name in [name for name in sys.modules if name.startswith("_catenary_kernel_")]:
        if getattr(sys.modules[name], "one", None) is not None:
            del sys.modules[name]
    module = load_module("robot", SOURCE, {}, folder)
    assert module.one(1.0) == 2.0
    return module


def file_in(folder: Path) -> Path:
    (file,) = folder.glob("robot-*.py")
    return file


def machine_code(folder: Path) -> list[Path]:
    return sorted((folder / "__pycache__").glob("robot-*"))


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_kernels_are_readable_and_writable_by_their_owner_only(folder: Path) -> None:
    before = os.umask(0)
    try:
        again(folder)
    finally:
        os.umask(before)
    assert mode(folder) == 0o700
    assert mode(file_in(folder)) == 0o600
    assert machine_code(folder)  # nobody else enters the folder, whatever the umask makes of the files
    assert again(folder).one.stats.cache_hits


@pytest.mark.parametrize("content", [b"", SOURCE.encode() + EVIL])
def test_a_file_with_other_content_is_never_run_but_made_anew(folder: Path, content: bytes) -> None:
    again(folder)
    file_in(folder).write_bytes(content)
    assert not again(folder).one.stats.cache_hits  # its machine code went with it
    assert file_in(folder).read_bytes() == SOURCE.encode()


@pytest.mark.parametrize("put", [Path.symlink_to, Path.hardlink_to, lambda file, _: file.mkdir()])
def test_what_stands_in_the_files_place_is_replaced_and_what_it_points_to_left_alone(folder, tmp_path, put):
    again(folder)
    file, elsewhere = file_in(folder), tmp_path / "elsewhere.py"
    elsewhere.write_bytes(SOURCE.encode())
    elsewhere.chmod(0o600)
    file.unlink()
    put(file, elsewhere)
    again(folder)
    assert file.is_file()
    assert not file.is_symlink()
    assert file.stat().st_ino != elsewhere.stat().st_ino
    assert elsewhere.read_bytes() == SOURCE.encode()


@pytest.mark.parametrize("rights", [0o770, 0o707, 0o750, 0o711])
def test_a_folder_that_others_could_enter_is_emptied(folder: Path, rights: int) -> None:
    again(folder)
    (folder / "planted").write_bytes(EVIL)
    for path in machine_code(folder):
        path.write_bytes(b"cos\nsystem\n(S'touch planted'\ntR.")  # a pickle that runs a command
        path.chmod(0o666)
    folder.chmod(rights)
    assert not again(folder).one.stats.cache_hits
    assert mode(folder) == 0o700
    assert not (folder / "planted").exists()


def test_a_link_in_the_folders_place_is_not_followed(folder: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    folder.parent.mkdir()
    folder.symlink_to(elsewhere)
    again(folder)
    assert not folder.is_symlink()
    assert list(elsewhere.iterdir()) == []


@pytest.mark.parametrize("whole_folder", [False, True])
def test_machine_code_that_is_a_link_is_not_read(folder: Path, tmp_path: Path, whole_folder: bool) -> None:
    again(folder)
    for k, path in enumerate([folder / "__pycache__"] if whole_folder else machine_code(folder)):
        path.rename(tmp_path / f"moved{k}")
        path.symlink_to(tmp_path / f"moved{k}")
    assert not again(folder).one.stats.cache_hits
    assert not (folder / "__pycache__").is_symlink()


def test_a_folder_above_that_others_can_write_to_is_not_used(folder: Path) -> None:
    folder.parent.mkdir()
    folder.parent.chmod(0o777)
    assert again(folder).__file__ is None
    assert not folder.exists()
    folder.parent.chmod(0o1777)  # as /tmp is: others cannot take our folder away
    assert again(folder).__file__ is not None


def test_files_of_another_user_are_not_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    again(folder)
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert again(folder).__file__ is None


def test_without_a_place_to_write_kernels_are_compiled_in_memory(folder, monkeypatch) -> None:
    def refuse(*_args: object, **_options: object) -> None:
        raise PermissionError("read-only")

    monkeypatch.setattr(cache, "_write", refuse)
    assert again(folder).__file__ is None
    monkeypatch.setattr(Path, "mkdir", refuse)
    assert again(folder).__file__ is None


def test_a_home_that_is_a_file_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "home").write_bytes(b"")
    assert again(tmp_path / "home" / "catenary" / "kernels").__file__ is None


def test_the_folder_is_where_the_platform_keeps_caches(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "catenary" / "kernels"
    monkeypatch.setenv(
        "XDG_CACHE_HOME", "relative"
    )  # to be ignored, says the XDG base directory specification
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "catenary" / "kernels"


def test_nothing_half_written_is_left(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    assert again(folder).__file__ is None
    assert [path for path in folder.iterdir() if path.name != "__pycache__"] == []


def test_a_source_that_fails_leaves_no_module(folder: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        load_module("robot", "1 / 0\n", {}, folder)
    with pytest.raises(ZeroDivisionError):
        load_module("robot", "1 / 0\n", {}, folder)
    assert np.isfinite(again(folder).one(1.0))
