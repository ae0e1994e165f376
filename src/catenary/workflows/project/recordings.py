"""A project's recordings as motion logs: extracted and synchronised."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from catenary.errors import ConfigError
from catenary.recording.bag_reader import open_recordings, rescue_of
from catenary.recording.logs import write_parquet
from catenary.workflows.project.folder import Project, contents, describe, hold, missing, write
from catenary.workflows.project.kinds import kind_of


def extract_recording(project: Project, name: str) -> bool:
    """Synchronise recordings/NAME into a motion log, NAME.parquet; return whether that had to be done.

    Of a recording that is not whole what is whole is taken; the report, the log's notes and the step say so
    (`rescued`).
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
        if not is_done and not hold(project.folder, [recording], noted):
            changed = [f"{recording}: is no longer what was recorded; what is there was extracted"]
    if outputs is None or changed:
        made_from = [contents(describe(project.folder, [recording]), below)]
    made_from += project.settings.columns

    def work() -> dict[str, Any]:
        sources = open_recordings([recording])
        result = kind_of(project.settings).synchronise(recording)
        found_whole = rescue_of(sources)
        is_whole = not any(source.damage for source in sources)
        rescued = None if is_whole else found_whole.as_data()
        notes = [] if is_whole else [f"rescued: {found_whole.text()}"]
        write_parquet(replace(result.log, notes=(*result.log.notes, *notes)), path)
        found = {
            "topics": [vars(topic) | {"longest_gap": topic.longest_gap} for topic in result.topics],
            "rows": len(result.log),
            "rows_without_encoder": result.without_encoder,
            "problems": [*notes, *changed, *(problem for source in sources for problem in source.problems)],
            "rescued": rescued,
        }
        write(report, found)
        return {} if rescued is None else {"rescued": rescued}

    return project.run(step, made_from, files, work)


def motion_log_path(project: Project, name: str) -> Path:
    """Return the path of a recording's motion log."""
    return project.folder / f"{name}.parquet"
