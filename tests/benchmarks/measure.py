"""Contenders measured side by side: alternated in one process, CPU time, medians of rounds."""

import argparse
import gc
import json
import os
import platform
import time
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from catenary import __version__

Call = Callable[[], object]
Loop = Callable[[int], None]
ROUNDS = 9
CALLS = 5000


def loop_of(call: Call) -> Loop:
    """Give a loop that calls as a program would: a `partial` as `f(a, b, c)`, without what a partial costs."""
    names: dict[str, object] = {"call": call, "repeat": repeat}
    arguments = ""
    if isinstance(call, partial) and not call.keywords:
        names["call"] = call.func
        names |= {f"a{k}": value for k, value in enumerate(call.args)}
        arguments = ", ".join(f"a{k}" for k in range(len(call.args)))
    taken = ", ".join(f"{name}={name}" for name in names)  # locals, as in a loop of one's own
    exec(f"def loop(count, {taken}):\n    for _ in repeat(None, count):\n        call({arguments})\n", names)
    loop: Loop = names["loop"]  # type: ignore[assignment]
    return loop


def side_by_side(
    contenders: dict[str, Call], *, calls: int = CALLS, rounds: int = ROUNDS
) -> dict[str, dict[str, float]]:
    """CPU time [us] per call, and wall-clock quantiles of single calls; ratios are to the first contender."""
    gc.collect()
    gc.disable()
    cpu: dict[str, list[float]] = {name: [] for name in contenders}
    wall: dict[str, list[int]] = {name: [] for name in contenders}
    loops = {name: loop_of(call) for name, call in contenders.items()}
    for loop in loops.values():
        loop(min(200, calls))
    for _ in range(rounds):
        for name, call in contenders.items():
            begin = time.thread_time_ns()
            loops[name](calls)
            cpu[name].append((time.thread_time_ns() - begin) / calls / 1000.0)
            for _ in range(calls):
                before = time.perf_counter_ns()
                call()
                wall[name].append(time.perf_counter_ns() - before)
    gc.enable()
    first = float(np.median(cpu[next(iter(contenders))]))
    return {
        name: {
            "cpu_us": float(np.median(cpu[name])),
            "ratio": float(np.median(cpu[name])) / first,
            "wall_median_us": float(np.median(wall[name])) / 1000.0,
            "wall_p99.9_us": float(np.quantile(wall[name], 0.999)) / 1000.0,
        }
        for name in contenders
    }


def tell(tables: dict[str, dict[str, dict[str, float]]]) -> None:
    """Print the tables, and write them as JSON where `--json` says."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", type=Path)
    path: Path | None = parser.parse_args().json
    about = machine()
    print(", ".join(f"{name} {value}" for name, value in about.items()))
    for title, table in tables.items():
        print(f"\n{title}")
        columns = list(next(iter(table.values())))
        wide = max(34, *(len(name) for name in table))
        widths = {column: max(12, len(column) + 2) for column in columns}
        print(f"  {'':{wide}}" + "".join(f"{column:>{width}}" for column, width in widths.items()))
        for name, row in table.items():
            print(
                f"  {name:{wide}}" + "".join(f"{row[column]:>{width}.4g}" for column, width in widths.items())
            )
    if path is not None:
        content: dict[str, Any] = {"machine": about, "tables": tables}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def machine() -> dict[str, str]:
    """What it ran on."""
    names = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": str(len(names)),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "catenary": __version__,
        "date": datetime.now(UTC).date().isoformat(),
        "load": f"{os.getloadavg()[0]:.1f}",  # programs that wanted a core in the last minute, this one included
    }
