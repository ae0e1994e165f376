"""Where compiled code is kept, and what becomes of it where it cannot be, in processes of an ordinary account."""

import errno
from pathlib import Path

import pytest

from catenary.kernels.folders import check_room
from without_home import installed, run

# a function of a file, as the package's, and a generated one, as robots' kernels
FUNCTIONS = """
from catenary.kernels.cache import load_module
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
def test_without_a_home_to_write_to_code_is_compiled_in_memory_and_one_note_says_so(
    site, tmp_path, home
) -> None:
    without = "import os\ndel os.environ['HOME']\n" if home is None else ""
    outcome = run(site, without + RUN, tmp_path, HOME=home or "")
    assert outcome.out == COMPILED
    assert is_one_note(outcome.err, f"neither {site} nor ~/.cache can be written to"), outcome.err
    assert list(tmp_path.iterdir()) == []  # numba makes no folder called ~


def test_in_a_folder_of_the_accounts_own_code_is_kept_and_no_note_is_made(site: Path, tmp_path: Path) -> None:
    for expected in (COMPILED, FOUND):
        outcome = run(site, RUN, tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
        assert (outcome.out, outcome.err) == (expected, "")


# numba's own folder, made by the account itself, as everybody's
OPEN = "import os\nos.makedirs('cache', 0o700)\nos.umask(0)\nos.mkdir('cache/numba')\nos.umask(0o22)\n"


def test_machine_code_that_others_could_have_put_there_is_not_read(site: Path, tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    kept = run(site, OPEN + RUN, tmp_path, XDG_CACHE_HOME=cache)
    assert kept.out == COMPILED
    assert is_one_note(kept.err, f"{cache}/numba can be written by others"), kept.err
    assert list((tmp_path / "cache" / "numba").rglob("*.nb?")) == []


def test_with_the_umask_of_ubuntus_accounts_code_is_kept_where_the_group_may_no_longer_write(
    site: Path, tmp_path: Path
) -> None:
    cache = tmp_path / "cache"
    umask = "import os\nos.umask(0o2)\nos.makedirs('cache/numba', exist_ok=True)\nos.chmod('cache', 0o700)\n"
    for expected in (COMPILED, FOUND):
        outcome = run(site, umask + RUN, tmp_path, XDG_CACHE_HOME=str(cache))
        assert (outcome.out, outcome.err) == (expected, "")
    assert (cache / "numba").stat().st_mode & 0o022 == 0


def test_a_folder_without_room_is_told_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", refuse)
    with pytest.raises(OSError, match="No space left on device") as found:
        check_room(tmp_path)
    assert found.value.filename == str(tmp_path)
