"""Try faults by seeds: `python -m tests.campaign [PART...]`, or `list`; docs/reliability.md tells what must hold.

PART is a name ("files.journal") or a group ("files"); all parts without one. A run adds what it tried to
DIR/campaign.json; without --count it tries what is left of each part's target.
"""

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.campaign.part import Part, chosen, found_parts
from tests.campaign.results import Results
from tests.campaign.run import run_part

OFTEN = 5.0  # between two writings of the results [s]


def main() -> int:
    """Run what the command line asks for; return 1 where something failed."""
    options = _options()
    if options.replay is not None:
        return replay(options.replay)
    results = Results(options.out)
    parts = chosen([name for name in options.parts if name != "list"])
    if "list" in options.parts:
        for name, (_, part) in parts.items():
            print(f"{name:24} {results.entry(part)['tried']:9,} of {part.target:9,}")
        return 0
    end = time.monotonic() + options.seconds
    failed = 0
    for left, (module, part) in zip(range(len(parts), 0, -1), parts.values(), strict=True):
        now = time.monotonic()
        share = now + max(end - now, 0.0) / left  # what one leaves is shared by those after it
        failed += _run(results, module, part, share, options)
    print(f"{results.path}{f': {failed} failed' if failed else ''}")
    return int(failed > 0)


def _run(results: Results, module: str, part: Part, deadline: float, options: argparse.Namespace) -> int:
    """Try seeds of a part; return how many failed."""
    begin, written, tried, failed = time.monotonic(), time.monotonic(), 0, 0
    waiting: dict[int, str | None] = {}

    def write() -> None:
        nonlocal written
        results.add(part, waiting, time.monotonic() - written)
        waiting.clear()
        written = time.monotonic()

    def tell(seed: int, why: str | None) -> None:
        nonlocal tried, failed
        waiting[seed] = why
        tried, failed = tried + 1, failed + (why is not None)
        if why is not None:
            print(f"{part.name}: seed {seed} failed: {why.strip().splitlines()[-1]}", flush=True)
        if time.monotonic() - written > OFTEN:
            write()

    try:
        for seeds in results.following(part, options.count):
            run_part(module, part, seeds, tell, deadline=deadline, out=options.out)
            if time.monotonic() > deadline:
                break
    finally:
        write()
    seconds = time.monotonic() - begin
    print(f"{part.name:24} {tried:9,} tried {failed:5,} failed {seconds:8.1f} s", flush=True)
    return failed


def replay(folder: Path) -> int:
    """Try a kept failure again, in this process and without limits; its exception ends the program."""
    _, part = found_parts()[folder.resolve().parent.name]
    with TemporaryDirectory() as scratch:
        part.attempt(lambda: part.case(int(folder.resolve().name), Path(scratch)))
    print(f"{folder}: held")
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help="name or group; list: what there is")
    parser.add_argument("--count", type=int, help="cases of each part; default: what is left of its target")
    parser.add_argument("--seconds", type=float, default=1800.0, help="of all parts together (default 1800)")
    parser.add_argument("--out", type=Path, default=Path("build/campaign"), help="folder of the results")
    parser.add_argument("--replay", type=Path, metavar="FAILURE", help="a folder below failures/, tried again")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
