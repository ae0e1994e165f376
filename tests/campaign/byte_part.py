"""A part of the campaign that reads damaged files of one format, each within its processor time."""

import contextlib
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from tests.campaign.part import Fell, Part

MUTANTS = 1600  # of each format
LONGEST = 5.0  # that reading a file may take [s] of processor time


def files_part(name: str, case: Callable[[int, Path], None]) -> Part:
    """Return the part of a format; a case is refused by a CatenaryError, or read."""
    return Part(f"files.{name}", MUTANTS, _timed(case), may_refuse=True, processor_time=120.0)


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
