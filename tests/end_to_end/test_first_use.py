"""A stranger's first afternoon: a recording, a model, an evaluation on another day, a look at the files."""

import contextlib
from pathlib import Path

import pytest

import command_line
import simulated_arm
from command_line import Outcome, in_its_own_process


def catenary(folder: Path, *arguments: str) -> Outcome:
    with contextlib.chdir(folder):
        return command_line.catenary(*arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two days of recordings, as the arm's owner would save them, and a model of the first."""
    folder = tmp_path_factory.mktemp("first_use")
    simulated_arm.write(folder / "monday.npz", seed=1, rows=900, units=None)
    simulated_arm.write(folder / "tuesday.npz", seed=1, rows=600, noise=2e-4, units=None)
    outcome = catenary(folder, "fit", "monday.npz", "--model", "linear", "--out", "arm.npz", "--report", "arm.html")
    assert outcome.code == 0, outcome
    return folder


def test_the_fit_leaves_model_card_and_page(folder: Path) -> None:
    assert {"arm.npz", "arm.card.json", "arm.html"} <= {path.name for path in folder.iterdir()}


def test_the_model_takes_most_of_the_error_away_on_another_day(folder: Path) -> None:
    outcome = catenary(folder, "evaluate", "arm.npz", "tuesday.npz", "--report", "tuesday.html", "--json")
    assert outcome.code == 0, outcome
    result = outcome.json
    assert result["seen_in_training"] == []
    assert all(joint["rmse"] < 0.05 * joint["raw_rmse"] for joint in result["joints"])
    assert "J3: RMSE" in (folder / "tuesday.html").read_text()


@pytest.mark.parametrize(("name", "kind"), [("monday.npz", "recording"), ("arm.npz", "calibration model")])
def test_check_in_a_shell_finds_nothing_wrong_with_any_of_the_files(folder, name, kind) -> None:
    with contextlib.chdir(folder):
        outcome = in_its_own_process("check", name)
    assert outcome.code == 0, outcome.out
    assert outcome.out.startswith(f"{name}: {kind}")
    assert outcome.err == ""
