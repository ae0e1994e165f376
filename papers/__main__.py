"""Every figure and table of the four papers, and beyond: python -m papers list | publish | NAME... | all."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from catenary.errors import CatenaryError
from papers.catalog import MODULES, experiment, named
from papers.experiment import NOMINAL, Case, Experiment, Outcomes, Scope
from papers.pages import publish
from papers.results_files import markdown, told_of, write_results
from papers.runner import Failure, run_cases
from papers.store import Finished, Store

DATA = Path(__file__).parents[2] / "shared" / "data"
OUT = Path("results/papers")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        prog="python -m papers",
        description="Run figures and tables of the papers on simulated robots and recordings: tables, a page, a "
        "picture, and a verdict on each claim. What has run is kept and not run again.",
        epilog="A name is that of an experiment, or the beginning of several: calibration, gravity, regressor, beyond.",
        allow_abbrev=False,
    )
    made.add_argument("names", nargs="+", metavar="NAME", help="list, publish, all, or names of experiments")
    made.add_argument("--seeds", type=_count, metavar="N", help="robots drawn beside the nominal one (5)")
    made.add_argument("--workers", type=_count, default=1, metavar="N", help="processes on this machine (1)")
    made.add_argument(
        "--cluster", metavar="ADDRESS", help="a Dask scheduler, tcp://HOST:PORT, in their place"
    )
    made.add_argument("--quick", action="store_true", help="a minute each, to see that it runs: no verdicts")
    made.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"where results go ({OUT})")
    made.add_argument(
        "--data", type=Path, default=DATA, metavar="DIR", help="recordings of real arms, where some are used"
    )
    return made


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: expected one or more")
    return int(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for; return how the program ends."""
    made = parser()
    told = made.parse_args(arguments)
    console = Console(stderr=True)
    try:
        if told.names == ["list"]:
            _list()
            return 0
        if told.names[0] == "publish":
            for path in publish(told.out, named(told.names[1:] or ["all"])):
                print(path)
            return 0
        names = named(told.names)
    except CatenaryError as error:
        made.error(str(error))
    failed = 0
    try:
        for name in names:
            failed += run_experiment(
                experiment(name),
                seeds=told.seeds,
                quick=told.quick,
                data=told.data,
                out=told.out,
                workers=told.workers,
                cluster=told.cluster,
                console=console,
            )
    except CatenaryError as error:
        made.error(str(error))
    return 1 if failed else 0


def run_experiment(
    asked: Experiment,
    *,
    seeds: int | None,
    quick: bool,
    data: Path,
    out: Path,
    workers: int,
    cluster: str | None,
    console: Console,
) -> int:
    """Run an experiment's cases, write and print what they show; return how many failed."""
    if asked.needs_data and not data.is_dir():
        console.print(f"{asked.name}: left out: no recordings in {data}; name their folder by --data")
        return 0
    drawn = (
        0
        if quick
        else asked.drawn
        if seeds is None
        else min(seeds, asked.drawn)
        if not asked.drawn
        else seeds
    )
    scope = Scope(
        robots=(NOMINAL, *range(1, drawn + 1)),
        networks=1 if quick else Scope.networks,
        quick=quick,
        data=data if data.is_dir() else None,
    )
    folder = out / "quick" if quick else out
    store = Store(out)
    cases = list(dict.fromkeys(asked.cases(scope)))
    here = [case for case in cases if store.read(case) is None]
    failures: list[Failure] = []
    if here:
        with Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
        ) as bar:
            task = bar.add_task(asked.name, total=len(cases), completed=len(cases) - len(here))

            def told(case: Case, ended: Finished | Failure) -> None:
                if isinstance(ended, Failure):
                    last = ended.told.strip().splitlines()[-1]
                    console.print(f"failed: {case.label}: {last}", markup=False, soft_wrap=True)
                bar.advance(task)

            failures = run_cases(cases, store, workers=workers, cluster=cluster, data=scope.data, told=told)
    kept = {case: finished for case in cases if (finished := store.read(case)) is not None}
    if not kept:
        console.print(f"{asked.name}: no case has a result; see {store.failures}")
        return len(failures)
    outcomes = Outcomes({case: finished.result for case, finished in kept.items()})
    content = write_results(folder, asked, scope, outcomes, list(kept.values()), len(cases) - len(kept))
    print(f"\n## {asked.title} ({asked.place})\n\n{told_of(content)}")
    for table in content["tables"]:
        print(f"\n{table['title']}\n\n{markdown(table)}")
    for claim in content["claims"]:
        print(
            f"- {claim['verdict']}: {claim['says']}. Published: {claim['published']}. Here: {claim['measured']}."
        )
    print(f"\n{folder / f'{asked.name}.html'}", flush=True)
    if failures:
        console.print(f"{asked.name}: {len(failures)} of {len(cases)} cases failed; see {store.failures}")
    return len(failures)


def _list() -> None:
    for name in MODULES:
        one = experiment(name)
        print(f"{name:28} {one.place}: {one.title} ({one.minutes:.0f} processor minutes)")


if __name__ == "__main__":
    sys.exit(main())
