"""Cases of a part, one after the other, with limits of memory and time: `python -m tests.campaign.child`.

Says on a pipe, a line of JSON each: the seed, and None or why it failed. A case that takes too much processor time ends
the process, after saying on standard error where it was.
"""

import faulthandler
import json
import math
import os
import resource
import shutil
import signal
import sys
import time
import traceback
import warnings
from importlib import import_module
from pathlib import Path

from tests.campaign.part import Part

LONGEST = 6000  # characters of a failure that are kept


def main(module: str, name: str, first: int, beyond: int, deadline: float, pipe: int, out: Path) -> None:
    """Run seeds from first to before beyond, until the deadline (time.monotonic); failures are kept under `out`."""
    (part,) = (part for part in import_module(module).PARTS if part.name == name)
    faulthandler.enable()
    faulthandler.register(signal.SIGXCPU, chain=True)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.set_inheritable(pipe, False)  # its end says that this process has ended
    if part.warnings_fail:
        _make_warnings_errors()
    if part.memory is not None:
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + part.memory, resource.RLIM_INFINITY))
    scratch = Path("scratch").absolute()  # the parent chose the folder
    with os.fdopen(pipe, "w", buffering=1) as told:
        told.write(json.dumps([first - 1, None]) + "\n")  # ready
        for seed in range(first, beyond):
            scratch.mkdir()
            why = _failure(part, seed, scratch)
            if why is not None:
                keep(scratch, out, name, seed, why)
            shutil.rmtree(scratch, ignore_errors=True)
            told.write(json.dumps([seed, why]) + "\n")
            if time.monotonic() > deadline:
                break


def _failure(part: Part, seed: int, folder: Path) -> str | None:
    begin = time.process_time()
    if math.isfinite(part.processor_time):  # the system ends a process that goes on for a second longer
        limit = math.ceil(begin + part.processor_time) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
    try:
        part.attempt(lambda: part.case(seed, folder))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, too, is no answer
        return "".join(traceback.format_exception(error))[-LONGEST:]
    taken = time.process_time() - begin
    if taken > part.processor_time:
        return f"took {taken:.1f} s of processor time, more than {part.processor_time:g} s"
    return None


def _make_warnings_errors() -> None:
    warnings.simplefilter("error")
    for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", kind)


def keep(scratch: Path, out: Path, name: str, seed: int, why: str) -> None:
    """Keep what a case left in its folder, and why it failed."""
    folder = out / "failures" / name / str(seed)
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if scratch.exists():
        shutil.copytree(scratch, folder, symlinks=True)
    folder.mkdir(exist_ok=True)
    (folder / "why.txt").write_text(why, encoding="utf-8", errors="backslashreplace")


if __name__ == "__main__":
    _, _module, _name, _first, _beyond, _deadline, _pipe, _out = sys.argv
    main(_module, _name, int(_first), int(_beyond), float(_deadline), int(_pipe), Path(_out))
