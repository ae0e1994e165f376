import json
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from catenary import __version__
from catenary.errors import InputError
from oracles.sweep_cases import become_older, calls, deadly, failing, not_plain, quick, summed
from papers import runner
from papers.experiment import Case, Result
from papers.runner import Failure, execute, fingerprint, run_cases
from papers.store import Finished, Store


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """Where cases leave a file for each call."""
    folder = tmp_path / "begun"
    folder.mkdir()
    return folder


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "out")


@contextmanager
def started(workers: int) -> Iterator[Any]:
    """Yield a Dask cluster that somebody else started."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0
    ) as local:
        yield local


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with started(2) as local:
        yield local


def sums(folder: Path, count: int) -> list[Case]:
    return [summed.case(number=k, folder=str(folder)) for k in range(count)]


def results(store: Store, cases: list[Case]) -> list[Result]:
    return [kept.result for case in cases if (kept := store.read(case)) is not None]


def as_bits(found: list[Result]) -> str:
    return json.dumps(found)  # shortest decimals that give the same double


def test_a_case_that_raises_is_kept_as_a_failure_and_the_others_end(store: Store, begun: Path) -> None:
    bad = [failing.case(number=7, folder=str(begun)), not_plain.case(number=8, folder=str(begun))]
    good = sums(begun, 2)
    told: list[tuple[Case, Finished | Failure]] = []
    failures = run_cases([bad[0], good[0], bad[1], good[1]], store, report=lambda *ended: told.append(ended))
    assert [failure.case for failure in failures] == bad
    assert "case 7 cannot be" in failures[0].text
    assert "not JSON serializable" in failures[1].text
    assert len(results(store, good)) == 2
    assert [case for case, _ in told] == [bad[0], good[0], bad[1], good[1]]
    kept = {path.stem: path.read_text() for path in store.failures.iterdir()}
    assert set(kept) == {case.key for case in bad}
    assert "failing(folder" in kept[bad[0].key]


def test_an_interrupted_sweep_goes_on_where_it_was_and_runs_nothing_twice(
    store: Store, tmp_path: Path, begun: Path
) -> None:
    cases = sums(begun, 5)

    def stop_at_the_third(case: Case, _: Finished | Failure) -> None:
        if case == cases[2]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_cases(cases, store, report=stop_at_the_third)
    assert [calls(begun, k) for k in range(5)] == [1, 1, 1, 0, 0]
    assert run_cases(cases, Store(tmp_path / "out")) == []
    assert [calls(begun, k) for k in range(5)] == [1] * 5
    assert run_cases(cases + cases, store) == []
    assert [calls(begun, k) for k in range(5)] == [1] * 5


def test_a_failed_case_runs_again_the_next_time_and_its_failure_is_forgotten(store: Store, begun: Path) -> None:
    case = quick.case(number=1, folder=str(begun))
    store.write_failure(case, "no disk")
    assert run_cases([case], store) == []
    assert list(store.failures.iterdir()) == []


def test_another_version_is_refused_and_named(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = quick.case(number=1, folder=str(begun))
    with pytest.raises(
        RuntimeError, match=f"another catenary or library .*{re.escape(fingerprint())}.* than asks .older"
    ):
        execute(case, None, "older")
    with pytest.raises(RuntimeError, match="quick: this worker has revision 1, and 2 is asked for"):
        execute(replace(case, revision=2), None, fingerprint())
    monkeypatch.setattr(runner, "robots_digest", lambda _: "0" * 64)
    assert "+0000000000000000, Python 3" in fingerprint()
    monkeypatch.setattr(runner, "versions", lambda: "numpy 1")
    assert fingerprint().endswith(", numpy 1")
    assert calls(begun, 1) == 0


def test_processor_time_is_told_beside_that_of_the_clock(begun: Path) -> None:
    waiting = execute(deadly.case(number=1, folder=str(begun), deaths=0), None, fingerprint())
    working = execute(summed.case(number=2, folder=str(begun)), None, fingerprint())
    assert waiting.processor_seconds < 0.1 < 0.2 <= waiting.seconds  # it sleeps for 0.2 s
    assert 0.0 < working.processor_seconds < working.seconds + 0.1  # one thread; 0.1 s for coarse clocks


@pytest.mark.slow
@pytest.mark.parametrize("where", ["processes", "cluster"])
def test_workers_give_the_same_and_results_are_there_as_cases_end(
    where: str, request: pytest.FixtureRequest, tmp_path: Path, begun: Path
) -> None:
    asked: dict[str, Any] = {"workers": 2}
    if where == "cluster":
        asked = {"cluster": request.getfixturevalue("cluster").scheduler_address}
    cases = sums(begun, 4)
    here, there = Store(tmp_path / "here"), Store(tmp_path / "there")
    run_cases(cases, here)
    assert run_cases(cases, there, **asked, until=time.time()) == []
    assert results(there, cases) == []  # no time is left, nothing begins
    assert run_cases(cases, there, **asked, until=time.time() + 600.0) == []
    assert as_bits(results(there, cases)) == as_bits(results(here, cases))
    many = [quick.case(number=k, folder=str(begun)) for k in range(100, 300)]
    partial: list[int] = []
    told: list[Case] = []

    def count(case: Case, _: Finished | Failure) -> None:
        told.append(case)
        partial.append(len(list(there.folder.iterdir())))

    assert run_cases(many, there, **asked, report=count) == []
    assert told == many
    assert partial == list(range(5, 205))
    assert all(calls(begun, case.arguments["number"]) == 1 for case in many)


@pytest.mark.slow
def test_a_worker_that_dies_is_told_and_what_had_ended_is_kept(store: Store, begun: Path) -> None:
    cases = [*sums(begun, 4), deadly.case(number=100, folder=str(begun), deaths=1)]
    with pytest.raises(InputError, match=r"a worker process died.*run it again"):
        run_cases(cases, store, workers=2)
    assert run_cases(cases, store, workers=2) == []
    assert len(results(store, cases)) == 5
    assert calls(begun, 0) == 1


@pytest.mark.slow
def test_a_worker_with_another_source_runs_nothing(store: Store, begun: Path) -> None:
    from distributed import Client

    with started(2) as older, Client(older) as client:
        client.run(become_older)
        failures = run_cases(sums(begun, 2), store, cluster=older.scheduler_address)
    assert len(failures) == 2
    assert all(f"another catenary or library ({__version__}, older+" in failure.text for failure in failures)
    assert list(begun.iterdir()) == []
