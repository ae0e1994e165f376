"""Recordings of another make as motion logs of a project, each read once by the mapping."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catenary.errors import InputError
from catenary.files import sha256_of
from catenary.plant import MotionLog
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.logs import Reading, read_log, read_recording, write_parquet
from catenary.workflows.project.folder import Project


@dataclass(frozen=True)
class Imported:
    """A recording of another make that was read, and where the project keeps it."""

    log: MotionLog
    path: Path  # imported/NAME.parquet
    made_from: Any

    @property
    def step(self) -> str:
        """Name of the step that keeps it."""
        return f"import {self.path.stem}"


def read_imports(project: Project, paths: Sequence[Path], mapping: RecordingMapping) -> list[Imported]:
    """Read recordings by a mapping, or what the project keeps of them; nothing is written.

    Raises:
        FileFormatError: A recording cannot be read.
        InputError: There is none of that name, or what the mapping names is not in it.
    """
    found = []
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: no such recording")
        parts = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        hashes = [sha256_of(part) for part in parts]
        kept = project.folder / "imported" / f"{path.stem}-{hashes[0][:8]}.parquet"
        made_from = [hashes, mapping.model_dump(mode="json")]
        if project.done(f"import {kept.stem}", made_from, [kept]):
            log = read_log(kept)
        else:
            log = read_recording(path, Reading(mapping=mapping))
        found.append(Imported(log, kept, made_from))
    return found


def keep_imports(project: Project, imports: Sequence[Imported]) -> list[Path]:
    """Write recordings that were read into the project, unless that was done; return the files."""
    for one in imports:

        def work(one: Imported = one) -> None:
            one.path.parent.mkdir(exist_ok=True)
            write_parquet(one.log, one.path)

        project.run(one.step, one.made_from, [one.path], work)
    return [one.path for one in imports]
