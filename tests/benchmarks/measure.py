"""Contenders measured side by side: alternated in one process, CPU time, medians of rounds."""

import argparse
import gc
import json
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Call = Callable[[], object]
ROUNDS = 9
CALLS = 5000


def side_by_side(
    contenders: dict[str, Call], *, calls: int = CALLS, rounds: int = ROUNDS
) -> dict[str, dict[str, float]]:
    """CPU time [us] per call, and wall-clock quantiles of single calls; ratios are to the first contender."""
    gc.collect()
    gc.disable()
    cpu: dict[str, list[float]] = {name: [] for name in contenders}
    wall: dict[str, list[int]] = {name: [] for name in contenders}
    for call in contenders.values():
        for _ in range(min(200, calls)):
            call()
    for _ in range(rounds):
        for name, call in contenders.items():
            begin = time.thread_time_ns()
            for _ in range(calls):
                call()
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
    for title, table in tables.items():
        print(f"\n{title}")
        columns = list(next(iter(table.values())))
        print(f"  {'':34}" + "".join(f"{column:>16}" for column in columns))
        for name, row in table.items():
            print(f"  {name:34}" + "".join(f"{row[column]:>16.3f}" for column in columns))
    if path is not None:
        content: dict[str, Any] = {"machine": machine(), "tables": tables}
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
    }
