"""Hold what commands claim against the truth: `python -m tests.truth`; writes table.md beside this file."""

import argparse
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.recording.import_formats.test_tracked_pose import NEAR_SINGULAR, NOISES, seen_by_a_tracker
from tests.truth.bench import (
    CLOCKS,
    FAILS,
    OWN,
    Outcome,
    checked,
    clocked,
    evaluated,
    fitted,
    refreshed,
    told_of_hours,
    told_together,
    tracked,
    windows,
)
from tests.truth.imports import imports
from tests.truth.recordings import Known, data_folder, dvrk, raven, real, simulated
from tests.truth.sensed_gravity import sensed_gravity
from tests.truth.spoilings import NOTHING, SPOILINGS, late
from tests.truth.torques import payloads, torques
from tests.truth.two_computers import two_computers
from tests.truth.unknown_arms import unknown_arms
from tests.verdict.test_check import TOGETHER
from tests.verdict.test_delay import periodic_arm

TABLE = Path(__file__).with_name("table.md")
REFRESH_SECONDS = 120.0
COMMANDS = {fitted: "fit", evaluated: "evaluate"}


def outcomes(only: str) -> Iterator[Outcome]:
    """Try the cases whose name holds what a regular expression finds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if re.search(only, "imports and units"):
            yield from imports(folder)
        for made in (*simulated(), *real()):
            known = made()
            for spoiling in SPOILINGS:
                for try_ in (fitted, evaluated):
                    if re.search(only, f"{COMMANDS[try_]}: {known.name}: {spoiling.name}"):
                        yield try_(known, spoiling, folder)
            for kind in ("linear", "learned", *(OWN if known.name == raven("random").name else ())):
                if re.search(only, f"fit: {known.name}, {kind}"):
                    yield fitted(known, NOTHING, folder, kind)
            for seconds in (120.0, 300.0):
                if re.search(only, f"check: {known.name}") and windows_of(known, seconds):
                    yield checked(known, seconds, folder)
        yield from (clocked(clock, folder) for clock in CLOCKS if re.search(only, f"clock: {clock}"))
        if re.search(only, "refresh"):
            yield from refreshes(folder)
        yield from two_computers(only, folder)
        yield from unknown_arms(only, folder)
        yield from torques(only)
        yield from payloads(only)
        yield from sensed_gravity(only)
        yield from unlike_others(only, folder)


def unlike_others(only: str, folder: Path) -> Iterator[Outcome]:
    """Try faults together, hours of a motion that repeats itself, and poses near a singularity."""
    for names, made in TOGETHER.items():
        if re.search(only, f"check: faults together: {names}"):
            yield told_together(names, made(), folder)
    for seconds in (0.0, 0.1):
        if re.search(only, name := f"a million rows, {seconds:g} s late"):
            yield told_of_hours(Known(name, (late(periodic_arm(999_600), seconds),), ()), seconds, folder)
    for robot, match, through, noise in ((*each, noise) for each in NEAR_SINGULAR for noise in NOISES):
        if re.search(only, f"check: poses of {robot} near a singularity"):
            seen = seen_by_a_tracker(robot, match, through, np.array(noise))
            yield tracked(robot, seen, np.array(noise), match)


def windows_of(known: Known, seconds: float) -> bool:
    """Whether recordings are long enough for a window."""
    return any(list(windows(log, seconds)) for log in known.logs)


def refreshes(folder: Path) -> Iterator[Outcome]:
    """Refresh models with two minutes of another day, of local motion and of full."""
    for train, day in ((raven("random").logs[0], raven("zigzag", 5).logs[0]),):
        for first, last in windows(day, REFRESH_SECONDS):
            yield refreshed("another RAVEN-II", train, day, folder, first, last)
    if data_folder().is_dir():
        train, day = dvrk("random_train").logs[0], dvrk("peg_transfer_train").logs[0]
        for k, (first, last) in enumerate(windows(day, REFRESH_SECONDS)):
            if k % 3 == 0:
                yield refreshed("real dVRK, surgical motion", train, day, folder, first, last)


def main() -> int:
    """Print each case as it ends; return 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--only", default="", help="cases whose name this regular expression finds; other rows of the table stay"
    )
    only = parser.parse_args().only
    rows = []
    for outcome in outcomes(only):
        rows.append(outcome)
        print(f"{outcome.verdict:18} {outcome.case:70} {outcome.claimed:60} {outcome.true}", flush=True)
    failed = sum(row.failed for row in rows)
    print(f"{failed} of {len(rows)} failed")
    written = {
        row.case: f"| {row.case} | {row.claimed.replace('|', '/')} | {row.true} | {row.verdict} |" for row in rows
    }
    if only:
        old = [
            line for line in TABLE.read_text().splitlines() if line.startswith("| ") and not line.startswith("| case")
        ]
        written = {line.split(" | ")[0][2:]: line for line in old} | written
    wrong = sum(f"| {FAILS}" in line for line in written.values())
    lines = [f"{wrong} of {len(written)} cases fail.", "", "| case | claimed | true | verdict |", "|---|---|---|---|"]
    TABLE.write_text("\n".join([*lines, *written.values()]) + "\n")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
