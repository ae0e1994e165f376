"""Parts of the campaign that read damaged files of one format, each within its processor time; and whole samples."""

import contextlib
import shutil
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

from tests.campaign.part import Fell, Part

MUTANTS = 1600  # of each format
LONGEST = 5.0  # that reading a file may take [s] of processor time


def sample(name: str) -> Path:
    """Return where a whole file is made, once in a child process, whose folder goes with it."""
    return Path(tempfile.mkdtemp(prefix="campaign-sample-")) / name


@cache
def linear_model() -> bytes:
    """A calibration model's file."""
    import numpy as np

    import catenary

    q = np.cumsum(np.random.default_rng(1).normal(scale=0.01, size=(400, 3)), axis=0)
    path = sample("model.npz")
    catenary.fit(q, q + 0.01 * np.sin(q), units=("rad", "rad", "m"), model="linear").save(path)
    return path.read_bytes()


def files_part(name: str, case: Callable[[int, Path], None], *, mutants: int = MUTANTS) -> Part:
    """Return the part of a format; a case is refused by a CatenaryError, or read."""
    return Part(f"files.{name}", mutants, _timed(case), may_refuse=True, processor_time=120.0)


def _timed(case: Callable[[int, Path], None]) -> Callable[[int, Path], None]:
    """Count the processor time of a case without that of making the samples and compiling, the first time."""
    is_warm = False

    def timed(seed: int, folder: Path) -> None:
        nonlocal is_warm
        if not is_warm:
            is_warm = True
            for warming in range(8):  # of each kind of sample, most likely
                (folder / "warming").mkdir()
                with contextlib.suppress(Exception):
                    case(-1 - warming, folder / "warming")
                shutil.rmtree(folder / "warming")
        begin = time.process_time()
        try:
            case(seed, folder)
        finally:
            taken = time.process_time() - begin
            if taken > LONGEST:
                raise Fell(f"took {taken:.1f} s of processor time, more than {LONGEST:g} s")

    return timed
