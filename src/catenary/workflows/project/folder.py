"""One folder for one calibration: its settings, what was recorded, fitted and found, step by step.

Every step writes its files and then a line into steps.json: what it was made from, and a hash of that. A step whose
settings and inputs are the same as before, and whose files are still there, is not run again.
"""

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from catenary import __version__
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.files import json_text, write_atomically
from catenary.recording.synchronise import state_columns
from catenary.trajectories.sinusoids import TURN_TIME
from catenary.trajectories.zigzag import DIRECTIONS, LEAST_SPARSITY, check_direction

SETTINGS, STEPS = "settings.json", "steps.json"
CONNECTIONS = ("simulation", "ros1", "ros2")
SHORTEST_TEST = 2.0 * TURN_TIME / 60.0  # [min] of any random motion
LONGEST_TEST = 48.0 * 60.0  # [min]


@dataclass(frozen=True)
class ProjectSettings:
    """Settings of a project; changing one repeats every step that depends on it."""

    robot: str = "raven2"
    side: str = "left"
    seed: int | None = None  # of a simulated robot; None for the nominal one
    base_tilt_deg: tuple[float, float] = (0.0, 0.0)  # roll, pitch
    payload_kg: float = 0.0
    direction: str = "J2-J3"
    sparsities: tuple[float, ...] = (1 / 2, 1 / 3, 1 / 4)
    test_minutes: float = 20.0
    state_rate_hz: float = 30.0
    connection: str = "simulation"  # or ros1, ros2: where the robot is
    form: str = "generator"  # of the zig-zag J1-J2-J3
    columns: tuple[str, ...] = ()  # further ones of raven_state that motion logs carry, or ("all",)

    def __post_init__(self) -> None:
        """Refuse settings that no robot or motion can have, before anything is written or moves."""
        tilt, sparsities = self.base_tilt_deg, self.sparsities
        level = len(tilt) == 2 and all(abs(angle) <= 180.0 for angle in tilt)
        sparse = len(sparsities) > 0 and all(LEAST_SPARSITY <= s <= 1.0 for s in sparsities)
        long = SHORTEST_TEST <= self.test_minutes <= LONGEST_TEST
        minutes = f"{SHORTEST_TEST:.3g} to {LONGEST_TEST:g} min"
        wrong = [
            f"{name}: expected {expected}, got {got}"
            for name, is_right, expected, got in (
                ("side", self.side in ("left", "right"), "left or right", self.side),
                ("seed", self.seed is None or self.seed >= 0, "zero or more", self.seed),
                ("base tilt", level, "roll and pitch of at most 180 deg", tilt),
                ("payload", 0.0 <= self.payload_kg < math.inf, "zero or more kg", self.payload_kg),
                ("direction", self.direction in DIRECTIONS, ", ".join(DIRECTIONS), self.direction),
                ("sparsity", sparse, f"numbers from {LEAST_SPARSITY} to 1", sparsities),
                ("test motion", long, minutes, self.test_minutes),
                ("connection", self.connection in CONNECTIONS, ", ".join(CONNECTIONS), self.connection),
                ("state rate", 0.0 < self.state_rate_hz <= 1000.0, "at most 1000 Hz", self.state_rate_hz),
            )
            if not is_right
        ]
        if wrong:
            raise InputError("; ".join(wrong))
        check_direction(self.direction, self.form)
        state_columns(self.columns)


class Project:
    """A folder and what has been done in it."""

    def __init__(self, folder: Path, settings: ProjectSettings) -> None:
        """Open a project, or begin one.

        Args:
            folder: Of the project.
            settings: Written into it.

        Raises:
            FileFormatError: The folder cannot be made, or holds other things than a project.
            ConfigError: Its steps.json is damaged.
        """
        self.folder, self.settings = folder, settings
        self.ran: list[str] = []  # steps that were run since it was opened; all others had been done
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileFormatError(f"{folder}: cannot be made a project: {error.strerror}") from error
        if any(folder.iterdir()) and not (folder / SETTINGS).is_file():
            raise FileFormatError(f"{folder}: is neither empty nor a project; give a new or an empty folder")
        self._steps: dict[str, dict[str, Any]] = {}
        path = folder / STEPS
        if path.is_file():
            try:
                self._steps = json.loads(path.read_text(encoding="utf-8"))
                for entry in self._steps.values():
                    entry["made_from"], entry["files"]
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                raise ConfigError(f"{path}: damaged: {error}; delete it to run every step again") from error
        write(folder / SETTINGS, asdict(settings))

    def done(self, step: str, made_from: Any, files: Sequence[Path]) -> bool:
        """Return whether a step was done with the same settings and inputs, and its files are there."""
        entry = self._steps.get(step)
        return (
            entry is not None
            and entry["made_from"] == fingerprint(made_from)
            and all(path.exists() for path in files)
        )

    def run(self, step: str, made_from: Any, files: Sequence[Path], work: Callable[[], Any]) -> bool:
        """Do a step unless it was done; return whether it was done now.

        Args:
            step: Its name.
            made_from: Everything that it depends on, as plain data.
            files: What it writes, files or folders.
            work: Does it.
        """
        if self.done(step, made_from, files):
            return False
        if self._steps.pop(step, None) is not None:  # what stops in the middle must not look done
            write(self.folder / STEPS, self._steps)
        work()
        self._steps[step] = {
            "made_from": fingerprint(made_from),
            "files": [str(path.relative_to(self.folder)) for path in files],
            "version": __version__,
        }
        write(self.folder / STEPS, self._steps)
        self.ran.append(step)
        return True

    def fingerprint_of(self, step: str) -> str:
        """Return the hash of what a step was made from; steps after it depend on that.

        Raises:
            ConfigError: The step was not done.
        """
        if step not in self._steps:
            raise ConfigError(f"{self.folder}: {step} was not done yet")
        return str(self._steps[step]["made_from"])


def project_settings(folder: Path) -> ProjectSettings | None:
    """Return the settings that a project was last opened with, or None where there is no project.

    Raises:
        ConfigError: The file is damaged, or from another version.
    """
    path = folder / SETTINGS
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        lists = {name: tuple(content[name]) for name in ("base_tilt_deg", "sparsities")}
        lists["columns"] = tuple(content.get("columns", ()))
        return ProjectSettings(**{**content, **lists})
    except (ValueError, KeyError, TypeError, InputError) as error:
        raise ConfigError(f"{path}: not the settings of a project: {error}") from error


def fingerprint(content: Any) -> str:
    """Return the hash of plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def write(path: Path, content: Any) -> None:
    """Write plain data as JSON.

    Raises:
        FileFormatError: The file cannot be written.
    """
    write_atomically(path, json_text(content).encode())
