"""Every figure and table of the four papers, and beyond: python -m papers list | judge | publish | NAME... | all."""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from catenary.errors import CatenaryError
from papers import authors
from papers.catalog import MODULES, experiment, named
from papers.pages import COMMITTED, confirm, publish, raw_results
from papers.sweep import judge, plan, sweep

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
    made.add_argument(
        "names",
        nargs="+",
        metavar="NAME",
        help="names of experiments, or all; list; judge, confirm or publish NAME ...; authors FOLDER",
    )
    made.add_argument(
        "--seeds",
        type=_count,
        metavar="N",
        help="robots drawn beside the nominal one, where any are (each experiment's own number: five, one or two of "
        "those that take long)",
    )
    made.add_argument("--workers", type=_count, default=1, metavar="N", help="processes on this machine (1)")
    made.add_argument("--cluster", metavar="ADDRESS", help="a Dask scheduler, tcp://HOST:PORT, in their place")
    made.add_argument(
        "--within", type=_count, metavar="MINUTES", help="begin no case later than this; run it again to go on"
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
    args = made.parse_args(arguments)
    console = Console(stderr=True)
    try:
        if args.names == ["list"]:
            _list()
            return 0
        if args.names[0] == "publish":
            for path in publish(args.out, named(args.names[1:]) if args.names[1:] else None):
                print(path)
            return 0
        if args.names[0] == "confirm":
            confirm(named(args.names[1:]))
            return 0
        if args.names[0] == "judge":
            for name in raw_results(args.names[1:]):
                judge(name, COMMITTED, args.out)
            return 0
        data = args.data if args.data.is_dir() else None
        planned = []
        if args.names[0] == "authors":
            if len(args.names) != 2:
                made.error("authors: expected the folder of their recordings")
            root = Path(args.names[1])
            planned, args.out = (authors.planned(root, quick=args.quick), args.out / f"authors-{authors.digest(root)}")
        else:
            for selected in map(experiment, named(args.names)):
                if selected.needs_data and data is None:
                    console.print(
                        f"{selected.name}: left out: no recordings in {args.data}; name their folder by --data"
                    )
                else:
                    planned.append(plan(selected, seeds=args.seeds, quick=args.quick, data=data))
    except CatenaryError as error:
        made.error(str(error))
    try:
        failed = sweep(
            planned, args.out, workers=args.workers, cluster=args.cluster, data=data, console=console,
            minutes=args.within or math.inf,
        )  # fmt: skip
    except CatenaryError as error:
        made.error(str(error))
    return 1 if failed else 0


def _list() -> None:
    every = [experiment(name) for name in MODULES]
    for one in every:
        print(f"{one.name:28} {one.place}: {one.title} ({one.minutes:.0f} processor minutes)")
    print(f"all: {sum(one.minutes for one in every) / 2 / 60:.1f} hours on two cores")


if __name__ == "__main__":
    sys.exit(main())
