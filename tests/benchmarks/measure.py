"""Contenders measured side by side: alternated in one process, CPU time, medians of rounds; and how it is told."""

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
Table = dict[str, dict[str, float]]  # values of each row, by their columns' names
Tables = dict[str, Table]  # by their titles
Loop = Callable[[int], None]
ROUNDS = 9
CALLS = 5000


def loop_of(call: Call) -> Loop:
    """Return a loop that calls as a program would: a `partial` as `f(a, b, c)`, without what a partial costs."""
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


def side_by_side(contenders: dict[str, Call], *, calls: int = CALLS, rounds: int = ROUNDS) -> Table:
    """Return CPU time [us] per call, and wall-clock quantiles of single calls; ratios are to the first contender."""
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


def cpu_time(call: Call) -> float:
    """Return the CPU time of one call, of all threads [s]."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def report(measured: Callable[..., Tables], about: str | None, **usual: Any) -> None:
    """Run a benchmark as its command line says; print its tables, and write them as JSON where `--json FILE` says.

    Args:
        measured: Gives the tables.
        about: The benchmark's docstring.
        usual: Further options, which `measured` takes, and what they are where they are not given; of a tuple any
            may be chosen.
    """
    form = argparse.ArgumentDefaultsHelpFormatter
    parser = argparse.ArgumentParser(description=about, formatter_class=form)
    parser.add_argument("--json", type=Path, help="where the tables go")
    for name, value in usual.items():
        if isinstance(value, tuple):
            parser.add_argument(f"--{name}", choices=value, action="append", help=f"by default all: {value}")
        else:
            parser.add_argument(f"--{name}", type=type(value), default=value, help=" ")
    given = vars(parser.parse_args())
    path: Path | None = given.pop("json")
    tables = measured(**{name: value or usual[name] for name, value in given.items()})
    about_machine = machine()
    print(", ".join(f"{name} {value}" for name, value in about_machine.items()))
    for title, table in tables.items():
        print_table(title, table)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        content = {"machine": about_machine, "tables": tables}
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def print_table(title: str, table: Table) -> None:
    """Print a table; its rows as columns where they are long, and what a row lacks as NaN."""
    values = list(dict.fromkeys(value for row in table.values() for value in row))
    if len(values) > 9:
        turned = {v: {name: row.get(v, np.nan) for name, row in table.items()} for v in values}
        values, table = list(table), turned
    wide = max(34, *map(len, table))
    print(f"\n{title}\n  {'':{wide}}" + "".join(f"{value:>{max(12, len(value) + 2)}}" for value in values))
    for name, row in table.items():
        print(f"  {name:{wide}}" + "".join(f"{row.get(v, np.nan):>{max(12, len(v) + 2)}.4g}" for v in values))


def machine() -> dict[str, str]:
    """Return what the benchmark ran on."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
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
