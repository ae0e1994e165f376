"""What a campaign has found, kept in one file that several runs add to: cases tried, failures."""

import json
import platform
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from catenary import __version__
from catenary.files import json_text, write_atomically
from tests.campaign.part import Part


class Results:
    """The file campaign.json of a folder: of each part how many seeds from 0 on were tried, and those that failed."""

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

    def entry(self, part: Part) -> dict[str, Any]:
        """Return what the file says of a part."""
        nothing: dict[str, Any] = {"tried": 0, "failures": [], "seconds": 0.0}
        return nothing | self.read()["parts"].get(part.name, {}) | {"target": part.target}

    def add(self, part: Part, tried: Mapping[int, str | None], seconds: float) -> None:
        """Add seeds with why they failed, None where they held, and how long that took."""
        if not tried:
            return
        content, entry = self.read(), self.entry(part)
        failures = {failure["seed"]: failure for failure in entry["failures"]}
        for seed, why in tried.items():
            if why is not None:
                failures[seed] = _failure(part, seed, why)
            elif (mended := failures.pop(seed, None)) is not None:
                shutil.rmtree(self.folder / mended["folder"], ignore_errors=True)
        entry["tried"] = max(entry["tried"], max(tried) + 1)
        entry["seconds"] = round(entry["seconds"] + seconds, 1)
        content["parts"][part.name] = entry | {"failures": [failures[seed] for seed in sorted(failures)]}
        content["parts"] = dict(sorted(content["parts"].items()))
        write_atomically(self.path, json_text(content | _about()).encode())

    def following(self, part: Part, count: int | None) -> Iterator[range]:
        """Yield ranges of seeds to try: those that failed, then as many new ones as asked for, else as the target wants."""
        entry = self.entry(part)
        for failure in entry["failures"]:
            yield range(failure["seed"], failure["seed"] + 1)
        wanted = max(part.target - entry["tried"], 0) if count is None else count
        if wanted:
            yield range(entry["tried"], entry["tried"] + wanted)


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
