import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time
from types import SimpleNamespace
from typing import Any

import pytest

from catenary import __version__
from catenary.errors import CatenaryError
from papers import __main__ as command
from papers import catalog, runner, sweep
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.kit import graded, table
from papers.results_files import RAW
from papers.store import Finished, Store


@run(revision=1)
def squared(number: int, arm: str = "") -> Result:
    if number < 0:
        raise ValueError(f"{number}: expected zero or more")
    return {"square": number**2}


def cases(scope: Scope) -> list[Case]:
    return [squared.case(number=0 if robot is None else robot) for robot in scope.robots]


def report(outcomes: Outcomes) -> Report:
    figure, (axes,) = panels(1, 2.0)
    axes.plot([result["square"] for result in outcomes.of(squared)])
    rows = [[str(told["number"]), str(result["square"])] for told, result in outcomes.items(squared)]
    return Report([table("Squares", "number | square", rows)], {"A curve": figure})


SQUARES = Experiment(
    "beyond-squares", "nowhere", "Squares", "Squares.\n\nNumbers times themselves.", cases, report, minutes=0.1, drawn=2
)


@SQUARES.claim("They grow", "I", "1 < 4", "each larger", fitted=True)
def grow(outcomes: Outcomes) -> Judgement:
    return graded(True, True, "0 < 1")


def ran(out: Path, *words: str, code: int = 0) -> dict[str, Any]:
    """Run the experiment; return what it leaves."""
    assert command.main(["calibration-table-1", *words, "--out", str(out)]) == code
    folder = out / "quick" if "--quick" in words else out
    found: dict[str, Any] = json.loads((folder / "beyond-squares.json").read_text())
    return found


@pytest.fixture(autouse=True)
def only_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "experiment", lambda name: SQUARES)


def test_an_experiment_writes_table_page_verdicts_and_the_same_picture_each_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = ran(tmp_path)
    printed = capsys.readouterr().out
    assert "| 2 | 4 |" in printed
    assert "reproduced: They grow" in printed
    assert (content["robots"], content["cases"], content["missing"]) == (["nominal", 1, 2], 3, 0)
    assert content["tables"][0]["rows"] == [["0", "0"], ["1", "1"], ["2", "4"]]
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", content["date"])
    assert content["version"] == __version__
    page = (tmp_path / "beyond-squares.html").read_text()
    for words in ("They grow", "reproduced (fitted)", "the simulated robot was fitted to this number"):
        assert words in page
    drawn = (tmp_path / "beyond-squares-1.svg").read_bytes()
    assert drawn.startswith(b"<?xml")
    assert ran(tmp_path) == content
    assert (tmp_path / "beyond-squares-1.svg").read_bytes() == drawn


def test_a_variant_of_the_robot_is_judged_beside_it_and_is_no_robot_of_the_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def both(scope: Scope) -> list[Case]:
        return [*cases(scope), squared.case(number=7, arm="raven2_eccentric.toml")]

    varied = replace(SQUARES, cases=both, claims=[])

    @varied.claim("All are below ten", "I", "-", "the greatest")
    def below(outcomes: Outcomes) -> Judgement:
        greatest = max(result["square"] for result in outcomes.of(squared))
        return graded(greatest < 10, False, str(greatest))

    monkeypatch.setattr(command, "experiment", lambda name: varied)
    content = ran(tmp_path)
    assert len(content["tables"][0]["rows"]) == 3
    (claim,) = content["claims"]
    assert (claim["verdict"], claim["measured"], claim["variant"]) == ("reproduced", "4", "49: not reproduced")


def test_the_date_and_the_minutes_are_those_of_the_cases_whenever_they_are_shown(tmp_path: Path) -> None:
    ended = ["2026-11-20T23:59:59+00:00", "2026-11-22T00:00:00+00:00", "2026-11-21T12:00:00+00:00"]
    store = Store(tmp_path)
    for case, date in zip(cases(Scope((None, 1, 2))), ended, strict=True):
        store.write(case, Finished({"square": 1}, 60.0, 30.0, "0.0.9", "abc", date))
    content = ran(tmp_path)
    assert (content["version"], content["date"]) == ("0.0.9", "2026-11-20 to 2026-11-22")
    assert content["processor_minutes"] == 1.5


def test_quick_results_hold_no_verdict_and_stand_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(tmp_path, "--quick")["claims"] == []
    assert "They grow" not in capsys.readouterr().out
    assert not (tmp_path / "beyond-squares.json").exists()


def test_a_failed_case_is_told_and_leaves_the_others_and_no_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = replace(SQUARES, cases=lambda scope: [squared.case(number=-1), squared.case(number=3)])
    monkeypatch.setattr(command, "experiment", lambda name: broken)
    assert (ran(tmp_path, code=1)["missing"]) == 1
    ended = capsys.readouterr()
    assert "| 3 | 9 |" in ended.out
    assert "They grow" not in ended.out
    assert "expected zero or more" in ended.err
    (kept,) = (tmp_path / "failures").iterdir()
    assert "Traceback" in kept.read_text()


def test_a_sweep_in_two_sittings_ends_as_one_does_and_raw_results_are_judged_without_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    minutes = iter([0.0, 0.5, 1.1])
    clock = SimpleNamespace(time=lambda: 60.0 * next(minutes), perf_counter=perf_counter, process_time=process_time)
    monkeypatch.setattr(sweep, "time", SimpleNamespace(time=lambda: 0.0))
    monkeypatch.setattr(runner, "time", clock)
    assert command.main(["calibration-table-1", "--within", "1", "--out", str(tmp_path)]) == 0
    assert "1 of 3 cases wait for another sitting: beyond-squares" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "beyond-squares.json").exists()
    monkeypatch.undo()
    monkeypatch.setattr(command, "experiment", lambda name: SQUARES)
    monkeypatch.setattr(sweep, "experiment", lambda name: SQUARES)
    content = ran(tmp_path)
    sweep.judge("beyond-squares", tmp_path, tmp_path / "judged")
    for name in ("beyond-squares.json", f"beyond-squares{RAW}", "beyond-squares-1.svg"):
        assert (tmp_path / "judged" / name).read_bytes() == (tmp_path / name).read_bytes()
    assert (content["robots"], content["cases"]) == (["nominal", 1, 2], 3)
    (tmp_path / f"beyond-squares{RAW}").write_bytes(b"of another run")
    with pytest.raises(CatenaryError, match="publish beyond-squares, or"):
        sweep.judge("beyond-squares", tmp_path / "judged", tmp_path)
    assert (tmp_path / f"beyond-squares{RAW}").read_bytes() == b"of another run"


def test_seeds_are_how_many_robots_are_drawn(tmp_path: Path) -> None:
    assert ran(tmp_path, "--seeds", "1")["robots"] == ["nominal", 1]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nonsense"], "choices: all"),
        (["all", "--seeds", "0"], "one or more"),
        ([], "NAME"),
        (["all", "--fast"], "--fast"),
        (["calibration-table-1", "--out", "a_file"], "name another folder by --out"),
        (["calibration-table-1", "--out", "a_file/below"], "name another folder by --out"),
        (["publish", "calibration-table-1", "--out", "nothing"], "run them first"),
        (["judge", "calibration-table-2", "--out", "nothing"], "no raw results"),
        (["calibration-table-1", "--within", "0"], "one or more"),
        (["calibration-table-1", "--cluster", "tcp://127.0.0.1:1"], "pip install"),  # Dask
    ],
)
def test_what_cannot_be_done_is_refused(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("papers.pages.COMMITTED", tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    (tmp_path / "a_file").write_text("mine")
    with pytest.raises(SystemExit) as end:
        command.main(words)
    assert end.value.code == 2
    assert told in " ".join(capsys.readouterr().err.split())
    assert (tmp_path / "a_file").read_text() == "mine"


def test_list_names_every_experiment_and_the_hours_of_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["list"]) == 0
    *listed, total = capsys.readouterr().out.splitlines()
    assert len(listed) == len(command.MODULES)
    assert total == f"all: {0.1 * len(command.MODULES) / 120:.1f} hours on two cores"  # 0.1 minutes each


def test_all_takes_half_a_day_at_most_on_two_cores_in_parts_of_two_hours() -> None:
    minutes = {name: catalog.experiment(name).minutes / 2 for name in catalog.MODULES}  # on two cores
    assert sum(minutes.values()) <= 12 * 60
    assert {name for name, taken in minutes.items() if taken >= 120} == set()
