"""Several experiments in one sweep: their cases together, each experiment shown as soon as its own have ended."""

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from catenary.errors import CatenaryError
from catenary.files import write_atomically
from papers.catalog import experiment
from papers.experiment import NOMINAL, Case, Experiment, Scope
from papers.results_files import RAW, made_with, markdown, write_results
from papers.runner import Failure, run_cases
from papers.store import Finished, Store, read_raw


@dataclass(frozen=True)
class Planned:
    """An experiment, how much of it is run, and the cases that takes."""

    experiment: Experiment
    scope: Scope
    cases: tuple[Case, ...]


def plan(experiment: Experiment, *, seeds: int | None, quick: bool, data: Path | None) -> Planned:
    """Return the cases that an experiment takes."""
    drawn = 0 if quick or not experiment.drawn else experiment.drawn if seeds is None else seeds
    robots = (NOMINAL, *range(1, drawn + 1))
    scope = Scope(robots, networks=1 if quick else Scope.networks, quick=quick, data=data)
    return Planned(experiment, scope, tuple(dict.fromkeys(experiment.cases(scope))))


def sweep(
    planned: Sequence[Planned],
    out: Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    data: Path | None = None,
    minutes: float = math.inf,
    console: Console,
) -> int:
    """Run what has no result yet; write every experiment's tables as its last case ends; return how many cases failed.

    After some minutes by the clock no case begins; the next sweep goes on with those that are left.
    """
    until = time.time() + 60.0 * minutes
    store = Store(out)
    cases = list(dict.fromkeys(case for one in planned for case in one.cases))
    waiting = {case for case in cases if store.read(case) is None}
    unshown = list(planned)

    def show_finished() -> None:
        for one in [each for each in unshown if waiting.isdisjoint(each.cases)]:
            unshown.remove(one)
            show(one, store, out, console)

    show_finished()
    failures: list[Failure] = []
    if waiting:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=console) as bar:
            task = bar.add_task("cases", total=len(cases), completed=len(cases) - len(waiting))

            def report(case: Case, ended: Finished | Failure) -> None:
                if isinstance(ended, Failure):
                    last = ended.text.strip().splitlines()[-1]
                    console.print(f"failed: {case.label}: {last}", markup=False, soft_wrap=True)
                bar.advance(task)
                waiting.discard(case)
                show_finished()

            failures = run_cases(cases, store, workers=workers, cluster=cluster, data=data, until=until, report=report)
    if len(waiting) > 0:
        names = ", ".join(one.experiment.name for one in unshown)
        console.print(f"{len(waiting)} of {len(cases)} cases wait for another sitting: {names}", soft_wrap=True)
    if failures:
        console.print(f"{len(failures)} of {len(cases)} cases failed; see {store.failures}", soft_wrap=True)
    return len(failures)


def show(planned: Planned, store: Store, out: Path, console: Console) -> None:
    """Write and print what an experiment's cases show, as far as they have results."""
    experiment, cases = planned.experiment, planned.cases
    kept = {case: finished for case in cases if (finished := store.read(case)) is not None}
    if not kept:
        console.print(f"{experiment.name}: no case has a result; see {store.failures}", soft_wrap=True)
        return
    missing = len(cases) - len(kept)
    show_results(experiment, planned.scope, kept, out / "quick" if planned.scope.quick else out, missing)


def judge(name: str, committed: Path, out: Path) -> None:
    """Write into a folder and print what committed raw results show today: no robot runs, no newer run is lost."""
    raw, newer = committed / f"{name}{RAW}", out / f"{name}{RAW}"
    if newer.is_file() and newer.read_bytes() != raw.read_bytes():
        raise CatenaryError(
            f"judge {name}: {newer} is another run than the committed one; publish {name}, or name a folder by --out"
        )
    kept = read_raw(raw)
    content = json.loads((committed / f"{name}.json").read_text(encoding="utf-8"))
    robots = tuple(NOMINAL if robot == "nominal" else robot for robot in content["robots"])
    show_results(experiment(name), Scope(robots), kept, out, 0)
    write_atomically(newer, raw.read_bytes())  # what the cases were made with stays as they tell it


def show_results(
    experiment: Experiment, scope: Scope, kept: Mapping[Case, Finished], folder: Path, missing: int
) -> None:
    """Write and print what results show."""
    content = write_results(folder, experiment, scope, kept, missing)
    print(f"\n## {experiment.title} ({experiment.place})\n\n{made_with(content)}")
    for table in content["tables"]:
        print(f"\n{table['title']}\n\n{markdown(table)}")
    for claim in content["claims"]:
        says = claim["says"].rstrip(".")
        print(f"- {claim['verdict']}: {says}. Published: {claim['published']}. Here: {claim['measured']}.")
    if missing:
        print(f"\n{missing} of {missing + len(kept)} cases are missing: no verdicts.")
    print(f"\n{folder / f'{experiment.name}.html'}", flush=True)
