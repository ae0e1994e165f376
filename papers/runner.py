"""Cases on this machine's processors, or on a Dask cluster: the same code, the same numbers.

Every result is kept as it comes, so that what is interrupted resumes. A case that fails leaves the others alone.
"""

import math
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

from catenary import __version__
from catenary.errors import InputError
from catenary.files import json_text
from catenary.parallel import Progress, of_each, on_workers
from catenary.robots.catalog import robot_names
from papers.environment import environment, versions
from papers.experiment import Case, robots_digest
from papers.store import Finished, Store, source_digest


class Failure(NamedTuple):
    """A case that did not end, and why."""

    case: Case
    text: str


OnEnd = Callable[[Case, Finished | Failure], None]


def fingerprint() -> str:
    """Return what has to be the same wherever cases of a sweep run: source, robots' data, and libraries' versions."""
    return f"{source_digest()}+{robots_digest(frozenset(robot_names()))[:16]}, {versions()}"


def execute(case: Case, data: Path | None, source: str) -> Finished:
    """Run a case, in whichever process."""
    if source != fingerprint():
        raise RuntimeError(
            f"this worker has another catenary or library ({__version__}, {fingerprint()}) than asks ({source})"
        )
    function = case.load()
    if function.revision != case.revision:
        raise RuntimeError(
            f"{case.function}: this worker has revision {function.revision}, and {case.revision} is asked for"
        )
    arguments = case.arguments
    if function.needs_data:
        arguments["data"] = data
    begin, busy = time.perf_counter(), time.process_time()
    result = function(**arguments)
    seconds, processor_seconds = time.perf_counter() - begin, time.process_time() - busy
    json_text(result)  # what cannot be kept is this case's failure, and nobody else's
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Finished(result, seconds, processor_seconds, __version__, source_digest(), date, environment())


def run_cases(
    cases: Sequence[Case],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    data: Path | None = None,
    until: float = math.inf,
    report: OnEnd = lambda case, ended: None,
) -> list[Failure]:
    """Run those cases that have no result yet, each once, and keep every result as it comes; return failures.

    One worker runs in this process. After `until`, on the clock of `time.time` [s], no further case begins.
    """
    missing = [case for case in dict.fromkeys(cases) if store.read(case) is None]
    failures: list[Failure] = []

    def keep(one: tuple[Case, Finished | Failure | None]) -> tuple[Case, None]:
        case, ended = one
        if isinstance(ended, Failure):
            failures.append(ended)
            store.write_failure(case, ended.text)
        elif ended is not None:
            store.write(case, ended)
        if ended is not None:
            report(case, ended)
        return case, None

    try:
        with on_workers(min(workers, max(1, len(missing))), cluster):
            of_each(partial(_ended, data=data, source=fingerprint(), until=until), missing, kept=keep)
    except BrokenExecutor as error:
        raise InputError(
            "a worker process died, of too little memory perhaps; what had ended is kept: run it again to go on, with "
            "--workers 1 if it dies again"
        ) from error
    return failures


def _ended(
    case: Case, _: Progress, data: Path | None, source: str, until: float
) -> tuple[Case, Finished | Failure | None]:
    """Run a case, in whichever process; return nothing of one that is too late to begin."""
    if time.time() >= until:
        return case, None
    try:
        return case, execute(case, data, source)
    except Exception:  # whatever a case raises is its own failure, and is kept and shown
        return case, Failure(case, traceback.format_exc())
