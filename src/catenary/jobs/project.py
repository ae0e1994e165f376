"""One folder for one calibration: its settings, what was recorded, fitted and found, step by step.

Every step writes its files and then a line into steps.json: what it was made from, and a hash of that. A step whose
settings and inputs are the same as before, and whose files are still there, is not run again.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from catenary import __version__
from catenary.errors import ConfigError, FileFormatError
from catenary.json_text import json_text

SETTINGS, STEPS = "settings.json", "steps.json"


@dataclass(frozen=True)
class ProjectSettings:
    """What a project is about; changing one repeats every step that depends on it."""

    robot: str = "raven2"
    side: str = "left"
    seed: int | None = None  # of a simulated robot; None for the nominal one
    base_tilt_deg: tuple[float, float] = (0.0, 0.0)  # roll, pitch
    payload_kg: float = 0.0
    direction: str = "J2-J3"
    sparsities: tuple[float, ...] = (1 / 2, 1 / 3, 1 / 4)
    test_minutes: float = 20.0
    state_rate_hz: float = 30.0


class Project:
    """A folder and what has been done in it."""

    def __init__(self, folder: Path, settings: ProjectSettings) -> None:
        """Open a project, or begin one.

        Raises:
            FileFormatError: The folder cannot be made, or holds other things than a project.
            ConfigError: Its steps.json is damaged.
        """
        self.folder, self.settings = folder, settings
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileFormatError(f"{folder}: cannot be made a project: {error.strerror}") from error
        if any(folder.iterdir()) and not (folder / SETTINGS).is_file():
            raise FileFormatError(f"{folder}: is not empty and no project; give a new or an empty folder")
        self._steps: dict[str, dict[str, Any]] = {}
        path = folder / STEPS
        if path.is_file():
            try:
                self._steps = dict(json.loads(path.read_text(encoding="utf-8")))
            except (json.JSONDecodeError, TypeError, ValueError) as error:
                raise ConfigError(f"{path}: damaged: {error}; delete it to run every step again") from error
        write(folder / SETTINGS, asdict(settings))

    def done(self, step: str, made_from: Any, files: Sequence[Path]) -> bool:
        """Whether a step was done with the same settings and inputs, and its files are there."""
        entry = self._steps.get(step)
        return (
            entry is not None
            and entry["made_from"] == fingerprint(made_from)
            and all(path.exists() for path in files)
        )

    def run(self, step: str, made_from: Any, files: Sequence[Path], work: Callable[[], Any]) -> bool:
        """Do a step unless it was done; whether it was done now.

        Args:
            step: Its name.
            made_from: Everything that it depends on, as plain data.
            files: What it writes, files or folders.
            work: Does it.
        """
        if self.done(step, made_from, files):
            return False
        self._steps.pop(step, None)
        work()
        self._steps[step] = {
            "made_from": fingerprint(made_from),
            "files": [str(path.relative_to(self.folder)) for path in files],
            "version": __version__,
        }
        write(self.folder / STEPS, self._steps)
        return True

    def fingerprint_of(self, step: str) -> str:
        """What a step was made from, as a hash; steps after it depend on that.

        Raises:
            ConfigError: The step was not done.
        """
        if step not in self._steps:
            raise ConfigError(f"{self.folder}: {step} was not done yet")
        return str(self._steps[step]["made_from"])


def project_settings(folder: Path) -> ProjectSettings | None:
    """Settings that a project was last opened with, or None where there is no project.

    Raises:
        ConfigError: The file is damaged, or from another version.
    """
    path = folder / SETTINGS
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return ProjectSettings(
            **{
                **content,
                "base_tilt_deg": tuple(content["base_tilt_deg"]),
                "sparsities": tuple(content["sparsities"]),
            }
        )
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: no settings of a project: {error}") from error


def fingerprint(content: Any) -> str:
    """Hash of plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def write(path: Path, content: Any) -> None:
    """Write plain data as JSON.

    Raises:
        FileFormatError: The file cannot be written.
    """
    try:
        path.write_text(json_text(content), encoding="utf-8")
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be written: {error.strerror or error}") from error
