"""A project's recordings as motion logs: extracted and synchronised, or third-party ones, read once by a mapping."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from catenary.errors import ConfigError, InputError
from catenary.files import sha256_of
from catenary.plant import MotionLog
from catenary.recording.bag_reader import open_recording, open_recordings, rescue_of
from catenary.recording.bag_writer import BagKind, write_group_bags
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.logs import Reading, read_log, read_recording, write_parquet
from catenary.workflows.project.folder import Project, contents, describe, missing, outputs_unchanged, write
from catenary.workflows.project.kinds import project_kind
from catenary.workflows.project.robot import clear_folder


def extract_recording(project: Project, name: str) -> bool:
    """Synchronise recordings/NAME into a motion log, NAME.parquet; return whether it had to be done.

    Of a damaged recording the undamaged part is taken; the report, the log's notes and the step say so (`rescued`).

    Args:
        name: Name of the recording.
    """
    path, report = motion_log_path(project, name), project.folder / f"{name}.synchronised.json"
    recording, step, files = project.folder / "recordings" / name, f"extract {name}", [path, report]
    if missing([recording]) and project.outputs_of(f"record {name}") is None:
        raise ConfigError(f"{project.folder}: record {name} was not done yet")

    below, outputs, changed = f"recordings/{name}", project.outputs_of(f"record {name}"), list[str]()
    made_from = list[str]()
    if outputs is not None:  # motion, and recorded files as their step noted them
        made_from = [project.fingerprint_of(f"record {name}"), contents(outputs, below)]
        noted = {key: one for key, one in outputs.items() if key.startswith(f"{below}/")}
        is_done = project.done(step, [*made_from, *project.settings.columns], files)
        if not is_done and not outputs_unchanged(project.folder, [recording], noted):
            changed = [f"{recording}: differs from what was recorded; its present content was extracted"]
    if outputs is None or changed:
        made_from = [contents(describe(project.folder, [recording]), below)]
    made_from += project.settings.columns

    def work() -> dict[str, Any]:
        sources = open_recordings([recording])
        result = project_kind(project.settings).synchronise(recording)
        rescue = rescue_of(sources)
        is_whole = not any(source.damage for source in sources)
        rescued = None if is_whole else rescue.as_data()
        notes = [] if is_whole else [f"rescued: {rescue.text()}"]
        write_parquet(replace(result.log, notes=(*result.log.notes, *notes)), path)
        content = {
            "topics": [vars(topic) | {"longest_gap": topic.longest_gap} for topic in result.topics],
            "rows": len(result.log),
            "rows_without_encoder": result.without_encoder,
            "problems": [*notes, *changed, *(problem for source in sources for problem in source.problems)],
            "rescued": rescued,
        }
        write(report, content)
        return {} if rescued is None else {"rescued": rescued}

    return project.run(step, made_from, files, work)


def write_bags(project: Project, name: str, kind: BagKind) -> list[Path]:
    """Write recordings/NAME as bags of RAVEN's group into bags/NAME, unless done; never over bags of others.

    Args:
        kind: Layout of the bags.
    """
    step, recording, folder = (f"bags {kind} {name}", project.folder / "recordings" / name, project.folder / "bags")
    files = [project.folder / written for written in project.outputs_of(step) or {}]
    made_from = contents(describe(project.folder, [recording]), f"recordings/{name}")

    def work() -> None:
        half, whole = folder / f"{name}.{kind}.part", folder / name
        for old in files:
            old.unlink(missing_ok=True)
        clear_folder(half)
        bags = write_group_bags(open_recording(recording), half, kind)
        whole.mkdir(exist_ok=True)
        there = [path for bag in bags if (path := whole / bag.name).is_file() or any(path.glob("*"))]
        if there:
            raise InputError(f"{there[0]}: exists already, and is never overwritten; delete it, and run this again")
        for bag in bags:
            bag.rename(whole / bag.name)
        half.rmdir()
        files[:] = [whole / bag.name for bag in bags]

    project.run(step, made_from, files, work)
    written = {Path(*Path(path).parts[:3]) for path in project.outputs_of(step) or {}}
    return sorted(project.folder / path for path in written)


def motion_log_path(project: Project, name: str) -> Path:
    """Return the path of a recording's motion log.

    Args:
        name: Name of the recording.
    """
    return project.folder / f"{name}.parquet"


@dataclass(frozen=True)
class Imported:
    """A third-party recording that was read, and where the project keeps it."""

    log: MotionLog
    path: Path  # imported/NAME.parquet
    made_from: Any


def read_imports(project: Project, paths: Sequence[Path], mapping: RecordingMapping) -> list[Imported]:
    """Read recordings by a mapping, or what the project keeps of them; nothing is written."""
    imports = []
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
        imports.append(Imported(log, kept, made_from))
    return imports


def keep_imports(project: Project, imports: Sequence[Imported]) -> list[Path]:
    """Write recordings that were read into the project, unless that was done; return the files."""
    for one in imports:

        def work(one: Imported = one) -> None:
            one.path.parent.mkdir(exist_ok=True)
            write_parquet(one.log, one.path)

        project.run(f"import {one.path.stem}", one.made_from, [one.path], work)
    return [one.path for one in imports]
