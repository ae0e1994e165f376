"""Cases on this machine's processors, or on a Dask cluster: the same code, the same numbers.

Every result is kept as it comes, so that what is interrupted resumes. A case that fails, or whose worker dies, leaves
the others alone.
"""

import os
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from threadpoolctl import threadpool_limits

from catenary import __version__
from papers.experiment import Case
from papers.store import Finished, Store, source_digest

# two threads on two busy cores are slower than one, and one alone gives the same sums everywhere
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
DEATHS = 1  # of workers over one case, before it is given up


class Failure(NamedTuple):
    """A case that did not end, and why."""

    case: Case
    told: str


Told = Callable[[Case, Finished | Failure], None]


def execute(case: Case, data: Path | None, source: str) -> Finished:
    """Run a case, in whichever process.

    Args:
        case: What is run.
        data: Folder of recordings of real arms, for cases that read some.
        source: Digest of the package where the results are kept.

    Raises:
        RuntimeError: This process has another version of the package.
    """
    if source != source_digest():
        raise RuntimeError(
            f"this worker has another catenary ({__version__}, {source_digest()}) than asks ({source})"
        )
    function = case.load()
    arguments = case.arguments
    if function.needs_data:
        arguments["data"] = data
    begin = time.perf_counter()
    with threadpool_limits(limits=1):
        result = function(**arguments)
    return Finished(result, time.perf_counter() - begin, __version__, source_digest())


def run_cases(
    cases: Sequence[Case],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    data: Path | None = None,
    told: Told = lambda case, ended: None,
) -> list[Failure]:
    """Run those cases that have no result yet, each once; keep every result as it comes.

    Args:
        cases: What is wanted.
        store: Where results are kept.
        workers: Processes on this machine; one runs in this process.
        cluster: Address of a Dask scheduler in place of these.
        data: Folder of recordings of real arms, the same path on every worker.
        told: Called as each case ends.

    Returns:
        The cases that failed.
    """
    missing = [case for case in dict.fromkeys(cases) if store.read(case) is None]
    failures: list[Failure] = []

    def keep(case: Case, ended: Finished | Failure) -> None:
        if isinstance(ended, Failure):
            failures.append(ended)
            store.write_failure(case, ended.told)
        else:
            store.write(case, ended)
        told(case, ended)

    if not missing:
        return failures
    if workers == 1 and cluster is None:
        for case in missing:
            keep(case, _here(case, data))
    else:
        with _client(min(workers, len(missing)), cluster) as client:
            for case, ended in _on(client, missing, data):
                keep(case, ended)
    return failures


def _here(case: Case, data: Path | None) -> Finished | Failure:
    try:
        return execute(case, data, source_digest())
    except Exception:  # whatever a case raises is its own failure, and is kept and shown
        return Failure(case, traceback.format_exc())


@contextmanager
def _client(workers: int, cluster: str | None) -> Iterator[Any]:
    """Yield a Dask client of the cluster at an address, or of processes started here."""
    import dask
    from distributed import Client, LocalCluster

    if cluster is not None:
        with Client(cluster) as client:
            yield client
        return
    os.environ.update(ONE_THREAD)  # read by BLAS when a worker imports it
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}),
        LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0
        ) as local,
        Client(local) as client,
    ):
        yield client


def _on(client: Any, cases: Sequence[Case], data: Path | None) -> Iterator[tuple[Case, Finished | Failure]]:
    from distributed import as_completed

    source = source_digest()
    futures = {
        client.submit(execute, case, data, source, key=case.key, retries=0, priority=-number): case
        for number, case in enumerate(cases)
    }
    for future in as_completed(futures):
        case = futures[future]
        if future.status == "finished":
            yield case, future.result()
        else:
            error = future.exception()
            told = "".join(traceback.format_exception(error))
            yield case, Failure(case, told or f"{future.status}")
        future.release()
