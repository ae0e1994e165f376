"""Commands of an account without a home, which may write nothing of the package that root installed."""

from pathlib import Path

import pytest

import simulated_arm
from without_home import installed, run


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed(tmp_path_factory.mktemp("installed"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the account works, beside recordings that it may read."""
    folder = tmp_path_factory.mktemp("work")
    simulated_arm.write(folder / "arm.npz", seed=1, rows=300)
    return folder


def assert_runs_with_one_note(site: Path, arguments: str, folder: Path) -> None:
    line = f"import sys\nsys.argv = ['catenary', *{arguments.split()!r}]\nfrom catenary.cli.main import main\nmain()"
    outcome = run(site, line, folder)
    assert outcome.code == 0, outcome.err
    assert outcome.out
    assert "Traceback" not in outcome.err
    assert outcome.err.count("cannot be kept for the next start") == 1, outcome.err
    assert "atplotlib" not in outcome.err  # which wants a home too


def test_gravity_is_computed(site: Path, folder: Path) -> None:
    assert_runs_with_one_note(site, "gravity raven2 --q 0,1.57,0.32", folder)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        "plot raven2 --out arm.png",
        "fit arm.npz --model linear --out model.npz --report model.html",
        "hold planar_3r --q 0.4,0.9,0.5 --seconds 0.1",
    ],
    ids=lambda arguments: arguments.split()[0],
)
def test_every_kind_of_command_runs_with_one_note(site: Path, folder: Path, arguments: str) -> None:
    assert_runs_with_one_note(site, arguments, folder)
