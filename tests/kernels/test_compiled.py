import errno
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest

from catenary.kernels.compiled import Compiled, cache_folder, check_room, compiled, inlined, load_module
from without_home import installed, run


@inlined
def three() -> float:
    return 3.0


@compiled
def unused(x: float) -> float:
    return x + three()


@compiled
def plus_three(x: float) -> float:
    return x + three()


@compiled
def doubled(x: float) -> float:
    return 2.0 * plus_three(x)


def test_a_compiled_function_is_numbas_in_its_own_file_from_its_first_call_on() -> None:
    assert isinstance(unused, Compiled)
    assert unused.__name__ == "unused"
    assert unused(2.0) == 5.0
    assert not isinstance(unused, Compiled)
    assert unused(3.0) == 6.0


def test_compiled_functions_call_those_that_nobody_has_called_yet() -> None:
    assert doubled(1.0) == 8.0


def test_importing_compiled_functions_and_asking_for_a_line_does_not_import_numba() -> None:
    code = (
        "import sys, catenary, catenary.gravity.torque, catenary.dynamics.inverse_dynamics, catenary.control.limits\n"
        "from catenary.gravity.compact_regressor import compact_regressor\n"
        "from catenary.dynamics.symbolic import gravity_line\n"
        "gravity_line(catenary.load_robot('raven2'))\n"
        "assert not {'numba', 'scipy', 'sklearn'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_code_on_disk_is_made_anew_when_a_file_that_it_calls_has_changed(tmp_path) -> None:
    head = "from catenary.kernels.compiled import compiled, inlined\n"
    caller = f"{head}from called import slope\n@compiled\ndef line(x):\n    return slope() * x\nprint(line(1.0))\n"
    (tmp_path / "caller.py").write_text(caller)
    for slope in ("2.0", "3.0"):
        (tmp_path / "called.py").write_text(f"{head}@inlined\ndef slope():\n    return {slope}\n")
        done = subprocess.run([sys.executable, "-B", tmp_path / "caller.py"], capture_output=True, check=True)
        assert done.stdout.decode().strip() == slope


def test_where_numba_is_told_to_compile_nothing_functions_run_as_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    @compiled
    def twice(x: float) -> float:
        return 2.0 * x

    assert twice(1.5) == 3.0


# a function of a file, as the package's, and a generated one, as robots' kernels
FUNCTIONS = """
from catenary.kernels.compiled import load_module
from catenary.kernels.compiled import compiled

@compiled
def twice(x):
    return 2.0 * x

print(twice(1.5))
one_more = load_module("robot", "@compiled\\ndef one(x):\\n    return x + 1.0\\n", {}).one
print(one_more(1.5), twice.stats.cache_hits and one_more.code.stats.cache_hits)
"""
RUN = "import functions"
COMPILED, FOUND = "3.0\n2.5 Counter()\n", "3.0\n2.5 Counter({(float64,): 1})\n"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package and a module with compiled functions, where nobody can write."""
    folder = tmp_path_factory.mktemp("installed")
    site = installed(folder)
    (site / "functions.py").write_text(FUNCTIONS)
    site.chmod(0o555)
    return site


def is_one_note(err: str, reason: str) -> bool:
    return err.count("\n") == 1 and "cannot be kept for the next start" in err and reason in err


@pytest.mark.parametrize("home", ["/nonexistent", "", None], ids=str)
def test_without_a_home_to_write_to_code_is_compiled_in_memory_and_one_note_says_so(site, tmp_path, home) -> None:
    without = "import os\ndel os.environ['HOME']\n" if home is None else ""
    outcome = run(site, without + RUN, tmp_path, HOME=home or "")
    assert outcome.out == COMPILED
    assert is_one_note(outcome.err, f"neither {site} nor ~/.cache can be written to"), outcome.err
    assert list(tmp_path.iterdir()) == []  # numba makes no folder called ~


# numba's own folder, made by the account itself, as everybody's
OPEN = "import os\nos.makedirs('cache', 0o700)\nos.umask(0)\nos.mkdir('cache/numba')\nos.umask(0o22)\n"


def test_machine_code_that_others_could_have_put_there_is_not_read(site: Path, tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    kept = run(site, OPEN + RUN, tmp_path, XDG_CACHE_HOME=cache)
    assert kept.out == COMPILED
    assert is_one_note(kept.err, f"{cache}/numba can be written by others"), kept.err
    assert list((tmp_path / "cache" / "numba").rglob("*.nb?")) == []


def test_in_a_folder_of_the_accounts_own_code_is_kept_and_no_note_is_made(site: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    # by Ubuntu's umask the group may write at first
    umask = "import os\nos.umask(0o2)\nos.makedirs('cache/numba')\nos.chmod('cache', 0o700)\n"
    for begin, expected in ((umask, COMPILED), ("", FOUND)):
        outcome = run(site, begin + RUN, tmp_path, XDG_CACHE_HOME=str(cache))
        assert (outcome.out, outcome.err) == (expected, "")
    assert (cache / "numba").stat().st_mode & 0o022 == 0


def test_a_folder_without_room_is_told_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", refuse)
    with pytest.raises(OSError, match="No space left on device") as found:
        check_room(tmp_path)
    assert found.value.filename == str(tmp_path)


SOURCE = "@compiled\ndef one(x):\n    return x + 1.0\n"
EVIL = b"raise SystemExit('foreign code ran')\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of one's own, with numba's files beside the kernels; nothing of it stays in this process."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
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

    monkeypatch.setattr("catenary.kernels.compiled._write", refuse)
    assert again(folder).__file__ is None
    monkeypatch.setattr(Path, "mkdir", refuse)
    assert again(folder).__file__ is None


def test_a_home_that_is_a_file_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "home").write_bytes(b"")
    assert again(tmp_path / "home" / "catenary" / "kernels").__file__ is None


def test_the_folder_is_where_the_platform_keeps_caches(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "catenary" / "kernels"
    # to be ignored, says the XDG base directory specification
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
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
