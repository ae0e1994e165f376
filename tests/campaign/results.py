"""What a campaign has found, kept in one file that several runs add to: seeds, failures."""

import fcntl
import json
import platform
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catenary import __version__
from catenary.files import json_text, write_atomically
from tests.campaign.part import Part

Ranges = list[list[int]]  # first and last of seeds in a row, ascending


class Results:
    """The file campaign.json of a folder; what it holds is read anew for each change, others may write it too.

    Each part has the seeds that were tried and the failures by their seeds, so that no case counts twice: trying a
    seed again replaces what was found.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.path = folder / "campaign.json"

    def read(self) -> dict[str, Any]:
        """Return what stands in the file."""
        if not self.path.exists():
            return {"parts": {}}
        found: dict[str, Any] = json.loads(self.path.read_text(encoding="utf-8"))
        return found

    def add(self, part: Part, tried: Mapping[int, str | None], seconds: float) -> None:
        """Add seeds with why they failed, None where they held, and how long that took."""
        if not tried:
            return
        with self._changing() as content:
            entry = content["parts"].setdefault(part.name, {"seeds": [], "failures": [], "seconds": 0.0})
            others = [failure for failure in entry["failures"] if failure["seed"] not in tried]
            for mended in (failure for failure in entry["failures"] if tried.get(failure["seed"], "no") is None):
                shutil.rmtree(self.folder / mended["folder"], ignore_errors=True)
            entry["failures"] = sorted(
                others + [_failure(part, seed, why) for seed, why in tried.items() if why is not None],
                key=lambda failure: int(failure["seed"]),
            )
            entry["seeds"] = ranges_of(seeds_of(entry["seeds"]) | tried.keys())
            content["parts"][part.name] = _counted(entry, part.target, round(entry["seconds"] + seconds, 1))
            content["parts"] = dict(sorted(content["parts"].items()))
            content |= _about()

    def following(self, part: Part, first: int, count: int | None) -> Iterator[range]:
        """Yield ranges of seeds to try: as many as asked for, else as many as the part's target still wants; from
        `first` on, leaving out those that held before."""
        entry = self.read()["parts"].get(part.name, {"seeds": [], "failures": []})
        done = seeds_of(entry["seeds"]) - {failure["seed"] for failure in entry["failures"]}
        wanted = max(part.target - len(done), 0) if count is None else count
        while wanted:
            while first in done:
                first += 1
            beyond = min((seed for seed in done if seed > first), default=first + wanted)
            yield range(first, min(beyond, first + wanted))
            wanted -= min(beyond, first + wanted) - first
            first = beyond

    @contextmanager
    def _changing(self) -> Iterator[dict[str, Any]]:
        with (self.folder / ".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            content = self.read()
            yield content
            write_atomically(self.path, json_text(content).encode())


def _counted(entry: dict[str, Any], target: int, seconds: float) -> dict[str, Any]:
    tried, failed = len(seeds_of(entry["seeds"])), len(entry["failures"])
    counts = {"target": target, "tried": tried, "held": tried - failed, "failed": failed}
    return {**entry, **counts, "seconds": seconds}


def seeds_of(ranges: Ranges) -> set[int]:
    """Return the seeds of ranges."""
    return {seed for first, last in ranges for seed in range(first, last + 1)}


def ranges_of(seeds: set[int]) -> Ranges:
    """Return seeds as ranges."""
    ranges: Ranges = []
    for seed in sorted(seeds):
        if ranges and ranges[-1][1] == seed - 1:
            ranges[-1][1] = seed
        else:
            ranges.append([seed, seed])
    return ranges


def _failure(part: Part, seed: int, why: str) -> dict[str, Any]:
    lines = why.strip().splitlines() or [""]
    said = lines[-1] if lines[0].startswith(("Traceback", "  +")) else lines[0]
    return {"seed": seed, "why": said[:300], "folder": f"failures/{part.name}/{seed}"}


def _about() -> dict[str, Any]:
    git = subprocess.run(
        ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
    )
    return {
        "version": __version__,
        "commit": git.stdout.strip() or None,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }
