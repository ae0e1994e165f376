"""One folder for one calibration: its settings, what was recorded, fitted and found, step by step.

Every step writes its files and then a line into steps.json: what it was made from, a hash of that, and size, time and
hashes of its files. A step whose settings and inputs are the same as before, and whose files hold what they held, is
not run again. One process at a time writes, under the folder's lock; what only reads needs none, and nothing is written
that did not change.
"""

import contextlib
import math
import os
import platform
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field

from catenary import __version__
from catenary.bounded_parsers import json_value, read_bounded
from catenary.config import IN_FILES, Recorded, parse_settings
from catenary.dvrk_psm import psm_topic
from catenary.errors import CatenaryError, ConfigError, FileFormatError, InputError, InUseError
from catenary.files import PARTIAL, damage, fingerprint, json_text, sha256_of, sweep_partial, write_atomically
from catenary.operating_system import OPEN_FILES_CAN_MOVE, OWN_FILE, lock, sync_file
from catenary.raven2.topics import further_columns
from catenary.trajectories.sinusoids import TURN_TIME_S
from catenary.trajectories.zigzag import DIRECTIONS, MIN_SPARSITY, check_direction

LOCK = ".lock"
_MAX_HOLDER_BYTES = 10_000  # of what the lock's file says


class FolderLock:
    """The lock of a folder: flock on a file that says who holds it, which the system frees when the process ends."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOCK
        self._descriptor: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether this object holds it."""
        return self._descriptor is not None

    def take(self) -> None:
        """Lock the folder, and say who does; not reentrant."""
        command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        since = datetime.now().astimezone().isoformat(timespec="seconds")
        holder = f"{command} (process {os.getpid()} on {platform.node()}) has been writing in it since {since}"
        with contextlib.ExitStack() as if_refused:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | OWN_FILE, 0o666)
                if_refused.callback(os.close, descriptor)
                lock(descriptor)
                os.ftruncate(descriptor, 0)
                os.write(descriptor, holder.encode("utf-8", "backslashreplace"))
            except BlockingIOError as error:
                occupant = os.read(descriptor, _MAX_HOLDER_BYTES).decode("utf-8", "replace")
                raise InUseError(
                    f"{self.path.parent}: {occupant or 'another process is writing in it'}; wait until it ends"
                ) from error
            except OSError as error:
                raise FileFormatError(f"{self.path}: cannot be locked: {error.strerror}") from error
            if_refused.pop_all()
        self._descriptor = descriptor

    def check(self) -> None:
        """Refuse to go on without the lock's file: another process may have made, and locked, a new one."""
        try:
            is_ours = self._descriptor is not None and (
                not OPEN_FILES_CAN_MOVE or os.path.samestat(os.fstat(self._descriptor), self.path.lstat())
            )
        except OSError:
            is_ours = False
        if not is_ours:
            raise InUseError(
                f"{self.path}: was deleted or replaced while this process wrote in the folder; nothing more is "
                "noted. Run the command again when no other process works there"
            )

    def release(self) -> None:
        """Release the lock, if it is held."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        with contextlib.suppress(OSError):  # what it says only tells
            os.ftruncate(descriptor, 0)
        os.close(descriptor)


_MAX_STATE_BYTES = 2**20  # steps.json of a hundred recordings has some 50 kB
Count = Annotated[int, Field(ge=0)]


class WrittenFile(Recorded):
    """A file that a step wrote."""

    size: Count
    mtime_ns: int
    sha256: str


class StepEntry(Recorded):
    """A step that was done, and what it wrote, by the files' names."""

    made_from: str
    files: tuple[str, ...]
    outputs: dict[str, WrittenFile]


class StepsFile(Recorded):
    """steps.json, below the key `steps`."""

    steps: dict[str, StepEntry]


def read_state(path: Path, schema: type[Any], remedy: str, *, below: str | None = None) -> Any:
    """Read a project's JSON file by its schema, whole or below a key; ConfigError names it and ends with the remedy."""
    try:
        content = json_value(read_bounded(path, _MAX_STATE_BYTES), str(path))
        parse_settings(content if below is None else {below: content}, schema, str(path))
    except FileFormatError as error:
        why = str(error).removeprefix(f"{path}: ").replace(f"\n{path}: ", "; ")
        raise ConfigError(damage(path, why, remedy)) from error
    return content


def describe(folder: Path, outputs: Sequence[Path]) -> dict[str, dict[str, Any]]:
    """Return `size`, `mtime_ns`, `sha256` of a step's files by their path, once their bytes are on the disk (fsync)."""
    described = {}
    for output in outputs:
        for path in _files(output):
            try:
                sync_file(path)
                content = _size_and_time(path) | {"sha256": sha256_of(path)}
            except OSError as error:
                raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
            described[path.relative_to(folder).as_posix()] = content
    return described


def missing(outputs: Sequence[Path]) -> list[Path]:
    """Return the outputs that are not there, folders without a file among them."""
    return [output for output in outputs if next(_files(output), None) is None]


def outputs_unchanged(folder: Path, outputs: Sequence[Path], described: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return True if files are as `describe` recorded them; same size and time are believed without hashing."""
    there = {path.relative_to(folder).as_posix(): path for output in outputs for path in _files(output)}
    return there.keys() == described.keys() and all(_holds(path, described[name]) for name, path in there.items())


def contents(described: Mapping[str, Mapping[str, Any]], output: str) -> str:
    """Return the hash of what the files below an output hold, by their names; times do not count."""
    below = {name: one["sha256"] for name, one in described.items() if name.startswith(f"{output}/")}
    return fingerprint(below)


def _holds(path: Path, described: Mapping[str, Any]) -> bool:
    try:
        now = _size_and_time(path)
        if now["size"] != described["size"]:
            return False
        return bool(now["mtime_ns"] == described["mtime_ns"] or sha256_of(path) == described["sha256"])
    except OSError:
        return False


def _size_and_time(path: Path) -> dict[str, int]:
    status = path.stat()
    return {"size": status.st_size, "mtime_ns": status.st_mtime_ns}


def _files(output: Path) -> Iterator[Path]:
    if not output.is_dir():
        if output.is_file():
            yield output
        return
    for folder, _, names in os.walk(output):
        yield from (path for name in sorted(names) if (path := Path(folder, name)).is_file())


SETTINGS, STEPS = "settings.json", "steps.json"
_ROBOTS = ("raven2", "dvrk_psm")
_CONNECTIONS = ("simulation", "ros1", "ros2")
_MIN_MOTION_MIN = 2.0 * TURN_TIME_S / 60.0  # of any random motion
_MAX_MOTION_MIN = 48.0 * 60.0


@dataclass(frozen=True)
class ProjectSettings:
    """Settings of a project, as settings.json holds them; changing one repeats every step that depends on it."""

    __pydantic_config__ = IN_FILES

    robot: str = "raven2"
    side: str = "left"
    seed: Annotated[int, Field(ge=0)] | None = None  # of a simulated robot; None for the nominal one
    base_tilt_deg: tuple[float, float] = (0.0, 0.0)  # roll, pitch
    payload_kg: float = 0.0
    direction: str = "J2-J3"
    sparsities: tuple[float, ...] = (1 / 2, 1 / 3, 1 / 4)
    test_minutes: float = 20.0
    state_rate_hz: float = 30.0
    connection: str = "simulation"  # or ros1, ros2: where the robot is
    form: str = "generator"  # of the zig-zag J1-J2-J3
    namespace: str = "/PSM1"  # of a dVRK PSM
    train_minutes: float = 20.0  # of the motion that a dVRK PSM is trained on
    columns: tuple[str, ...] = ()  # further ones of raven_state that motion logs carry, or ("all",)
    random_seconds: float = 30.0  # of random motion after a zig-zag, which cannot tell a joint's own delay; 0 for none

    def __post_init__(self) -> None:
        """Refuse settings that no robot or motion can have, before anything is written or moves."""
        tilt, sparsities = self.base_tilt_deg, self.sparsities
        level = len(tilt) == 2 and all(abs(angle) <= 180.0 for angle in tilt)
        sparse = len(sparsities) > 0 and all(MIN_SPARSITY <= s <= 1.0 for s in sparsities)
        long = _MIN_MOTION_MIN <= self.test_minutes <= _MAX_MOTION_MIN
        training = _MIN_MOTION_MIN <= self.train_minutes <= _MAX_MOTION_MIN
        after = self.random_seconds == 0.0 or 2.0 * TURN_TIME_S <= self.random_seconds <= 60.0 * _MAX_MOTION_MIN
        minutes = f"{_MIN_MOTION_MIN:.3g} to {_MAX_MOTION_MIN:g} min"
        wrong = [
            f"{name}: expected {expected}, got {got}"
            for name, is_right, expected, got in (
                ("robot", self.robot in _ROBOTS, f"one of {', '.join(_ROBOTS)}", self.robot),
                ("side", self.side in ("left", "right"), "left or right", self.side),
                ("seed", self.seed is None or self.seed >= 0, "zero or more", self.seed),
                ("base tilt", level, "roll and pitch of at most 180 deg", tilt),
                ("payload", 0.0 <= self.payload_kg < math.inf, "zero or more kg", self.payload_kg),
                ("direction", self.direction in DIRECTIONS, ", ".join(DIRECTIONS), self.direction),
                ("sparsity", sparse, f"numbers from {MIN_SPARSITY} to 1", sparsities),
                ("test motion", long, minutes, self.test_minutes),
                ("training motion", training, minutes, self.train_minutes),
                ("random motion", after, f"0, or {2.0 * TURN_TIME_S:g} s and more", self.random_seconds),
                ("connection", self.connection in _CONNECTIONS, ", ".join(_CONNECTIONS), self.connection),
                ("state rate", 0.0 < self.state_rate_hz <= 1000.0, "at most 1000 Hz", self.state_rate_hz),
            )
            if not is_right
        ]
        if wrong:
            raise InputError("; ".join(wrong))
        if self.robot == "dvrk_psm":
            psm_topic(self.namespace, "measured_js")  # refuses a namespace that no PSM has
            if self.payload_kg != 0.0 or self.side != "left" or self.columns:
                raise InputError("robot dvrk_psm: has neither --side nor --payload nor --columns of raven_state")
        check_direction(self.direction, self.form)
        further_columns(self.columns, "gold")


class Project:
    """A folder and what has been done in it, under its lock; one refused before anything is there goes away again."""

    def __init__(self, folder: Path, settings: ProjectSettings) -> None:
        """Open a project, or begin one; the settings are written into it where they differ from its own."""
        self.folder, self.settings = folder, settings
        self.ran: list[str] = []  # steps that were run since it was opened; all others had been done
        self._lock, self._depth = FolderLock(folder), 0
        self._made = [path for path in (folder, *folder.parents) if not path.exists()]  # the deepest first
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = "is a file, expected a folder" if folder.is_file() else f"cannot be made a project: {error.strerror}"
            raise FileFormatError(f"{folder}: {why}") from error
        names = {path.name for path in folder.iterdir() if path.suffix != PARTIAL} - {LOCK}
        if names and not is_project(folder):
            raise FileFormatError(f"{folder}: is neither empty nor a project; give a new or an empty folder")
        self._is_new = not names
        self._steps = self._read_steps()
        if not self._has_settings():
            with self:
                self._lock.take()
                write(folder / SETTINGS, asdict(settings))

    def done(self, step: str, made_from: Any, files: Sequence[Path]) -> bool:
        """Return True if a step was done from the same inputs, and its files hold its results (`state.hold`)."""
        entry = self._steps.get(step)
        if entry is None or entry["made_from"] != fingerprint(made_from):
            return False
        return outputs_unchanged(self.folder, files, entry["outputs"])

    def run(
        self,
        step: str,
        made_from: Any,
        files: Sequence[Path],
        work: Callable[[], Mapping[str, Any] | None],
        *,
        trusted: bool = True,
    ) -> bool:
        """Do a step unless it was done with `made_from`, plain data, and its files hold; return whether it was done.

        What `work` returns is noted beside it. A step that is not `trusted` is done; one that left no files is not
        noted.
        """
        if trusted and self.done(step, made_from, files):
            return False
        with self.writing():
            if trusted and self.done(step, made_from, files):  # by another process, before this one had the lock
                return False
            if self._steps.pop(step, None) is not None:  # what stops in the middle must not look done
                write(self.folder / STEPS, self._steps)
            noted = work()
            self._lock.check()
            lacking = ", ".join(map(str, missing(files)))
            if lacking:
                raise FileFormatError(
                    f"{lacking}: not there, although {step} has just written it; was it deleted meanwhile? "
                    "The step is not noted as done: run the same command again"
                )
            self._steps[step] = {
                "made_from": fingerprint(made_from),
                "files": [path.relative_to(self.folder).as_posix() for path in files],
                "version": __version__,
                "outputs": describe(self.folder, files),
                **(noted or {}),
            }
            write(self.folder / STEPS, self._steps)
        self.ran.append(step)
        return True

    def fingerprint_of(self, step: str) -> str:
        """Return the hash of what a step was made from; steps after it depend on that."""
        if step not in self._steps:
            raise ConfigError(f"{self.folder}: {step} was not done yet")
        return str(self._steps[step]["made_from"])

    def outputs_of(self, step: str) -> dict[str, Any] | None:
        """Return a step's outputs by `describe`; None if it was not done."""
        return self._steps[step]["outputs"] if step in self._steps else None

    def __enter__(self) -> Self:
        """Keep the folder's lock, once a step has taken it, until the end."""
        self._depth += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Give the lock back; what was begun for something that is refused goes away."""
        self._depth -= 1
        if self._depth == 0:
            try:
                if self._is_new and kind is not None and issubclass(kind, CatenaryError):
                    self._leave_nothing()
            finally:
                self._lock.release()

    def _leave_nothing(self) -> None:
        """Remove the settings and the folders made for them, unless another file or another process is there."""
        ours = {self.folder / SETTINGS, self.folder / LOCK}
        below = sorted(self.folder.rglob("*"), reverse=True)
        if any(path not in ours and not path.is_dir() for path in below):
            return
        with contextlib.suppress(OSError, InUseError, FileFormatError):
            if not self._lock.is_held:
                self._lock.take()
            if not OPEN_FILES_CAN_MOVE:
                self._lock.release()
            for path in [*below, self.folder / LOCK]:
                path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)
            for path in self._made:
                path.rmdir()

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the folder's lock; refused where another process holds it, or has changed the settings since."""
        with self:
            if not self._lock.is_held:
                self._lock.take()
                if not self._has_settings():
                    raise InUseError(
                        f"{self.folder}: another command changed its settings meanwhile; run this one again"
                    )
                self._steps = self._read_steps()
                sweep_partial(self.folder)
            yield

    def _has_settings(self) -> bool:
        path = self.folder / SETTINGS
        return path.is_file() and path.read_bytes() == json_text(asdict(self.settings)).encode()

    def _read_steps(self) -> dict[str, dict[str, Any]]:
        path = self.folder / STEPS
        if not path.is_file():
            return {}
        remedy = "delete it, and `catenary calibrate PROJECT` does every step again"
        return dict(read_state(path, StepsFile, remedy, below="steps"))


def is_project(folder: Path) -> bool:
    """Return True if a folder holds a project: its settings, or at least its finished steps."""
    return any((folder / name).is_file() for name in (SETTINGS, STEPS))


def project_settings(folder: Path) -> ProjectSettings | None:
    """Return the settings that a project was last opened with, or None if there is no project."""
    path = folder / SETTINGS
    if not path.is_file():
        return None
    remedy = "delete it, and give the settings again: `catenary calibrate PROJECT` with its options"
    try:
        content = read_state(path, ProjectSettings, remedy)
    except ConfigError as error:
        message = str(error).replace("file: Value error, ", "not the settings of a project: ")
        raise ConfigError(message) from error
    content = {"random_seconds": 0.0, **content}  # of projects begun before there was any
    lacking = ", ".join(field.name for field in fields(ProjectSettings) if field.name not in content)
    if lacking:
        raise ConfigError(damage(path, f"keys are missing: {lacking}", remedy))
    return parse_settings(content, ProjectSettings, str(path))


def write(path: Path, content: Any) -> None:
    """Write plain data as JSON, unless the file holds just that."""
    data = json_text(content).encode()
    if path.is_symlink() or not path.is_file() or path.read_bytes() != data:
        write_atomically(path, data)
