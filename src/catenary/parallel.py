"""Independent parts of a long task, and its progress: one after the other, or side by side on workers.

Workers are processes of this machine or of a Dask cluster, by joblib.
Each part runs with one thread of linear algebra wherever it runs, so the numbers are the same to the last bit on
machines with the same processor and libraries.
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from threadpoolctl import threadpool_limits

from catenary import __version__
from catenary.errors import InputError

Progress = Callable[[float], None]  # called with the share done, 0 to 1
Item = TypeVar("Item")
Result = TypeVar("Result")
_CLUSTER_TIMEOUT = "10 s"  # for a cluster


def silent(_: float) -> None:
    """Report no progress."""


def part_of(progress: Progress, part: int, parts: int) -> Progress:
    """Return the progress callback of one part of a task of equal parts.

    Args:
        progress, part, parts: Callback of the whole task, for 0 to 1; index and number of parts.
    """
    return lambda done: progress((part + done) / parts)


@contextmanager
def on_workers(workers: int = 1, cluster: str | None = None) -> Iterator[None]:
    """Run independent parts of tasks in parallel, within a `with` block.

    Args:
        workers: Processes on this machine; 1 is this process alone.
        cluster: Address of a Dask scheduler, tcp://HOST:PORT, in their place; InputError if it does not answer.
    """
    from joblib import parallel_config

    if cluster is None:
        with parallel_config("loky", n_jobs=workers):
            yield
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("--cluster: Dask is not installed; pip install distributed") from error
    try:
        client = Client(cluster, timeout=_CLUSTER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"cluster {cluster}: no scheduler answers: {error}; expected an address such as tcp://HOST:8786"
        ) from error
    with client:
        versions = set(client.run(_version).values())
        if versions != {__version__}:
            running = ", ".join(sorted(versions)) or "no worker"
            raise InputError(f"cluster {cluster}: has {running}, expected workers with catenary {__version__}")
        with parallel_config("dask", client=client), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")  # each part takes its recording with it
            yield


def of_each(
    work: Callable[[Item, Progress], Result],
    items: Sequence[Item],
    *,
    progress: Progress = silent,
    kept: Callable[[Result], Result] = lambda result: result,
) -> list[Result]:
    """Return work(item, progress of it) of every item, in order; side by side where `on_workers` says so.

    Args:
        kept: What is kept of each result, in this process, as soon as it is there.
    """
    from joblib import Parallel, delayed, effective_n_jobs

    count, results = len(items), []
    if min(effective_n_jobs(None), count) < 2:  # the default of joblib: what `on_workers` says, else 1
        return [kept(_alone(work, item, part_of(progress, i, count))) for i, item in enumerate(items)]
    for result in Parallel(return_as="generator")(delayed(_alone)(work, item, silent) for item in items):
        results.append(kept(result))
        progress(len(results) / count)
    return results


def _alone(work: Callable[[Item, Progress], Result], item: Item, progress: Progress) -> Result:
    with threadpool_limits(limits=1):
        return work(item, progress)


def _version() -> str:
    return __version__
