"""Recordings of another make as motion logs of a project, each read once by the mapping."""

from collections.abc import Sequence
from pathlib import Path

from catenary.errors import InputError
from catenary.files import sha256_of
from catenary.recording.foreign.mapping import RecordingMapping
from catenary.recording.foreign.read import Reading, read_recording
from catenary.recording.logs import write_parquet
from catenary.workflows.project.folder import Project


def import_recordings(project: Project, paths: Sequence[Path], mapping: RecordingMapping) -> list[Path]:
    """Import recordings into imported/NAME.parquet, unless that was done; return these files.

    Raises:
        FileFormatError: A recording cannot be read.
        InputError: There is none of that name, or what the mapping names is not in it.
    """
    logs = []
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: no such recording")
        parts = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        hashes = [sha256_of(part) for part in parts]
        log = project.folder / "imported" / f"{path.stem}-{hashes[0][:8]}.parquet"

        def work(path: Path = path, log: Path = log) -> None:
            log.parent.mkdir(exist_ok=True)
            write_parquet(read_recording(path, Reading(mapping=mapping)), log)

        made_from = [hashes, mapping.model_dump(mode="json")]
        project.run(f"import {log.stem}", made_from, [log], work)
        logs.append(log)
    return logs
