"""Cases on this machine's processors, or on a Dask cluster: the same code, the same numbers.

Every result is kept as it comes, so that what is interrupted resumes. A case that fails, or whose worker dies, leaves
the others alone.
"""

import logging
import math
import os
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from threadpoolctl import threadpool_limits

from catenary import __version__
from catenary.errors import InputError
from catenary.files import json_text
from catenary.robots.catalog import robot_names
from papers.environment import environment, processor, versions
from papers.experiment import Case, robots_digest
from papers.store import Finished, Store, source_digest

# two threads on two busy cores are slower than one, and one alone gives the same sums everywhere
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
PATIENCE = 30.0  # [s] for a cluster's worker, the first one or one that comes back
AGAIN = "-again"  # key of a case's second try
LOGGER = logging.getLogger(__name__)


class NoWorkerError(InputError):
    """A cluster whose workers have all gone."""


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
    with threadpool_limits(limits=1):
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

    One worker runs in this process. After `until`, on the clock of `time.monotonic` [s], no further case begins.
    """
    missing = [case for case in dict.fromkeys(cases) if store.read(case) is None]
    failures: list[Failure] = []

    def keep(case: Case, ended: Finished | Failure) -> None:
        if isinstance(ended, Failure):
            failures.append(ended)
            store.write_failure(case, ended.text)
        else:
            store.write(case, ended)
        report(case, ended)

    if not missing:
        return failures
    if workers == 1 and cluster is None:
        for case in missing:
            if time.monotonic() < until:
                keep(case, _here(case, data))
    else:
        with _client(min(workers, len(missing)), cluster) as client:
            for case, ended in _on(client, missing, data, until):
                keep(case, ended)
    return failures


def _here(case: Case, data: Path | None) -> Finished | Failure:
    try:
        return execute(case, data, fingerprint())
    except Exception:  # whatever a case raises is its own failure, and is kept and shown
        return Failure(case, traceback.format_exc())


@contextmanager
def _client(workers: int, cluster: str | None) -> Iterator[Any]:
    """Yield a Dask client of the cluster at an address, or of processes started here."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:
        raise InputError(
            f"several workers and clusters need Dask, and {error.name} is not installed: pip install -e .[papers]"
        ) from error
    if cluster is not None:
        try:
            connected = Client(cluster)
        except (OSError, ValueError) as error:
            raise InputError(
                f"cluster {cluster}: no scheduler answers: {error}; expected an address as tcp://HOST:PORT"
            ) from error
        with connected as client:
            _require_same(client, cluster)
            with _patient(client):
                yield client
        return
    os.environ.update(ONE_THREAD)  # read by BLAS when a worker imports it
    settings = {
        # a case whose worker dies is tried once more by `_on`, and no other case has to wait beside it
        "distributed.scheduler.allowed-failures": 0,
        "distributed.scheduler.worker-saturation": 1.0,
        # compiled code may keep a worker from answering for longer than any time to live
        "distributed.scheduler.worker-ttl": None,
        # a worker that starts again when this time is over, however long after it died, would be ended for good
        "distributed.deploy.lost-worker-timeout": "1000 h",
    }
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", memory_limit=0
        ) as local,
        Client(local) as client,
    ):
        yield client


@contextmanager
def _patient(client: Any) -> Iterator[None]:
    """Let a cluster that somebody else started treat cases as one of ours does, while they run.

    A case whose worker dies fails at once, where a scheduler would give it to three workers more; and compiled code may
    keep a worker from answering.
    """

    def exchange(settings: tuple[int, float | None], dask_scheduler: Any) -> tuple[int, float | None]:
        before = dask_scheduler.allowed_failures, dask_scheduler.worker_ttl
        dask_scheduler.allowed_failures, dask_scheduler.worker_ttl = settings
        return before

    before = client.run_on_scheduler(exchange, (0, math.inf))
    try:
        yield
    finally:
        client.run_on_scheduler(exchange, before)


def _require_same(client: Any, cluster: str) -> None:
    """Refuse a cluster whose workers would give other numbers than this process."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        fingerprints: dict[str, str] = client.run(fingerprint)
    except TimeoutError as error:
        raise InputError(f"cluster {cluster}: no worker within {PATIENCE:g} s") from error
    except ModuleNotFoundError as error:
        raise InputError(f"cluster {cluster}: {error} on its workers; start them beside papers/") from error
    if others := [f"{address} ({one})" for address, one in fingerprints.items() if one != fingerprint()]:
        raise InputError(
            f"cluster {cluster}: workers with another catenary or library than here ({__version__}, {fingerprint()}): "
            f"{', '.join(others)}"
        )
    unlike = {address: one for address, one in client.run(processor).items() if one != processor()}
    if unlike:
        texts = "; ".join(f"{address}: {one}" for address, one in unlike.items())
        LOGGER.warning(
            "cluster %s: last digits will differ, as docs/papers.md says: other processors than here (%s): %s",
            cluster,
            processor(),
            texts,
        )


def _on(
    client: Any, cases: Sequence[Case], data: Path | None, until: float
) -> Iterator[tuple[Case, Finished | Failure]]:
    """Run cases at once; those whose worker died are tried once more at the end, one by one.

    A worker that dies takes along whatever had been given to it; a case that kills its worker alone costs no other.
    """
    from distributed import KilledWorker

    dead: dict[Case, Finished | Failure] = {}
    try:
        for case, ended, error in _ended(client, cases, data, until=until):
            if isinstance(error, KilledWorker):
                dead[case] = ended
            else:
                yield case, ended
        for case in tuple(dead):
            for _, ended, _ in _ended(client, [case], data, AGAIN):
                del dead[case]
                yield case, ended
    except NoWorkerError:
        yield from dead.items()
        raise


def _ended(
    client: Any, cases: Sequence[Case], data: Path | None, suffix: str = "", until: float = math.inf
) -> Iterator[tuple[Case, Finished | Failure, BaseException | None]]:
    """Yield cases as they end, with the exception of those that failed; cases wait here where the time is limited."""
    from distributed import as_completed

    source, waiting = fingerprint(), list(reversed(cases))
    running: dict[Any, Case] = {}

    def submit() -> None:
        at_once = len(cases) if math.isinf(until) else max(1, sum(client.nthreads().values()))
        while waiting and len(running) < at_once and time.monotonic() < until:
            case = waiting.pop()
            key, priority = f"{case.key}{suffix}", len(waiting)
            running[client.submit(execute, case, data, source, key=key, retries=0, priority=priority)] = case

    submit()
    while running:
        try:
            for future in as_completed(list(running), timeout=PATIENCE):
                case = running.pop(future)
                if future.status == "finished":
                    yield case, future.result(), None
                else:
                    error = future.exception()
                    text = "".join(traceback.format_exception(error))
                    yield case, Failure(case, text or f"{future.status}"), error
                future.release()
                if waiting:
                    submit()
                    break
        except TimeoutError:  # a long case, or nobody is there to run any
            _require_worker(client, len(running) + len(waiting))


def _require_worker(client: Any, waiting: int) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise NoWorkerError(
            f"no worker is left: {waiting} cases wait; start workers again, and the sweep goes on where it is"
        ) from error
