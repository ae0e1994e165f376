"""Parts run in child processes that may die: which seeds were tried, and what failed."""

import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.campaign.child import LONGEST, keep
from tests.campaign.part import Part

ROOT = Path(__file__).parents[2]
START = 120.0  # the longest that imports may take [s], on a busy machine
Tell = Callable[[int, str | None], object]  # takes a seed, and why it failed


def run_part(module: str, part: Part, seeds: range, tell: Tell, *, deadline: float, out: Path) -> None:
    """Try seeds of a part until a deadline (time.monotonic), one at least, in a child process.

    A child that ends in a case, by a crash, for memory or for time, has failed that case; another one goes on after it.
    """
    while seeds:
        following = _run_child(module, part, seeds, tell, deadline, out)
        seeds = range(following, seeds.stop if time.monotonic() < deadline else following)


def _run_child(module: str, part: Part, seeds: range, tell: Tell, deadline: float, out: Path) -> int:
    """Run a child process until it ends; return the seed that is next."""
    folder = Path(tempfile.mkdtemp(prefix="campaign-"))
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "tests.campaign.child", module, part.name, str(seeds.start), str(seeds.stop)]
    try:
        with (folder / "output").open("wb") as output:
            process = subprocess.Popen(
                [*command, str(deadline), str(writing), str(out.absolute())],
                cwd=folder,
                env=_environment(folder),
                pass_fds=[writing],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        os.close(writing)
        with os.fdopen(reading, "rb", buffering=0) as pipe:
            following, why = _listen(pipe.fileno(), part, seeds.start, tell)
        why = _end(process, why)
        if why is None:
            return following
        output_text = (folder / "output").read_text(errors="replace")[-LONGEST:]
        if following < seeds.start:
            raise RuntimeError(f"{part.name}: did not start: {why}\n{output_text}")
        keep(folder / "scratch", out, part.name, following, f"{why}\n{output_text}")
        tell(following, f"{why}\n{output_text}")
        return following + 1
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _listen(pipe: int, part: Part, first: int, tell: Tell) -> tuple[int, str | None]:
    """Hear a child until it ends or is silent for too long: the seed that is next, before the first where it never was
    ready, and what it did not do in time."""
    following, rest, patience = first - 1, b"", START
    while True:
        if not select.select([pipe], [], [], patience)[0]:
            return following, f"did not end within {patience:g} s"
        patience = part.patience
        read = os.read(pipe, 65536)
        if not read:
            return following, None
        *lines, rest = (rest + read).split(b"\n")
        for seed, why in map(json.loads, lines):
            following = seed + 1
            if seed >= first:  # else it is ready
                tell(seed, why)


def _end(process: "subprocess.Popen[bytes]", why: str | None) -> str | None:
    """Wait for a child, killed where it hangs, and end what it has started; return how it failed, if it did."""
    if why is not None:
        process.send_signal(signal.SIGABRT)  # says where it is
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
    if process.returncode is None:
        if why is not None:
            process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # its number stays its own until it is waited for
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    code = process.wait()
    if why is not None or code == 0:
        return why
    if code == -signal.SIGXCPU:
        return "took too much processor time"
    return f"the process ended by {signal.Signals(-code).name}" if code < 0 else f"the process ended with {code}"


def _environment(folder: Path) -> dict[str, str]:
    return {
        "XDG_CACHE_HOME": str(ROOT / ".cache"),
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src"), str(ROOT / "tests")]),
        "TMPDIR": str(folder),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "2",  # else each thread reserves address space, which is limited
        "ARROW_DEFAULT_MEMORY_POOL": "system",
    }
