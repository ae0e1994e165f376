"""Cases for tests of sweeps: their calls are counted by files, as processes share no memory."""

import os
import signal
import time
import uuid
from pathlib import Path

import numpy as np

from papers.experiment import Result, run


def calls(folder: Path, number: int) -> int:
    """Return how often a case has begun."""
    return len(list(folder.glob(f"{number}-*")))


def _begin(folder: str, number: int) -> int:
    """Leave a file, and return which call of the case this is."""
    (Path(folder) / f"{number}-{uuid.uuid4().hex}").touch()
    return calls(Path(folder), number)


@run(revision=1)
def summed(*, number: int, folder: str, size: int = 300) -> Result:
    """Sum what depends on the order of sums: products of random matrices, by BLAS."""
    _begin(folder, number)
    rng = np.random.default_rng(number)
    a, b = rng.normal(size=(2, size, size))
    product = a @ b @ a.T
    return {"number": number, "sum": float(product.sum()), "row": np.linalg.solve(product, b)[0, :5].tolist()}


@run(revision=1)
def quick(*, number: int, folder: str) -> Result:
    """End at once."""
    _begin(folder, number)
    return {"number": number}


@run(revision=1)
def failing(*, number: int, folder: str) -> Result:
    """Raise."""
    _begin(folder, number)
    raise ValueError(f"case {number} cannot be")


@run(revision=1)
def not_plain(*, number: int, folder: str) -> Result:
    """Return what no file can keep."""
    _begin(folder, number)
    return {"number": {number}}


@run(revision=1)
def deadly(*, number: int, folder: str, deaths: int) -> Result:
    """Kill the process in the middle of the case, the first times that it is called."""
    call = _begin(folder, number)
    time.sleep(0.2)
    if call <= deaths:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"number": number, "calls": call}


def become_older() -> None:
    """Make this process one whose package has another source."""
    from papers import runner

    runner.source_digest = lambda: "older"  # type: ignore[assignment]
