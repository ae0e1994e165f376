"""Extract and synchronise a project's recordings into motion logs, whatever robot they are of."""

from pathlib import Path

from catenary.errors import ConfigError
from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.outputs import contents, describe, hold, missing
from catenary.workflows.project.robot import arm_of, empty


def extract_recording(project: Project, name: str) -> bool:
    """Extract recordings/NAME and synchronise it into a motion log, NAME.parquet; return whether that had to be done.

    A recording that no step made, but somebody put there or an older version recorded without moving the robot, is
    extracted as well.

    Raises:
        ConfigError: There is no such recording.
        InUseError: Another process is writing in the project.
    """
    from catenary.recording.extract import extract
    from catenary.recording.logs import write_parquet
    from catenary.recording.synchronise import SynchroniseOptions, synchronise

    folder = project.folder / "extracted" / name
    path, report = motion_log_path(project, name), project.folder / f"{name}.synchronised.json"
    recording, step, files = project.folder / "recordings" / name, f"extract {name}", [path, report, folder]
    if missing([recording]) and project.outputs_of(f"record {name}") is None:
        raise ConfigError(f"{project.folder}: record {name} was not done yet")
    made_from, changed = _noted(project, name), []
    if made_from is None:
        made_from = [contents(describe(project.folder, [recording]), f"recordings/{name}")]
    elif not project.done(step, made_from, files) and not _is_as_noted(project, name, recording):
        changed = [f"{recording}: is no longer what was recorded; what is there was extracted"]
        made_from = [contents(describe(project.folder, [recording]), f"recordings/{name}")]

    def work() -> None:
        empty(folder)
        extraction = extract([recording], folder)
        arm = SynchroniseOptions(arm=arm_of(project))
        result = synchronise(folder, arm)
        write_parquet(result.log, path)
        found = {
            "topics": [vars(topic) | {"longest_gap": topic.longest_gap} for topic in result.topics],
            "stopped_encoders": [stop.note() for stop in result.stopped],
            "rows": len(result.log),
            "rows_without_encoder": result.without_encoder,
            "problems": [*changed, *extraction.problems],
        }
        write(report, found)

    return project.run(step, made_from, files, work)


def _noted(project: Project, name: str) -> list[str] | None:
    """Return the motion of a recording and what was recorded of it, as its step noted them; None without one."""
    step = f"record {name}"
    outputs = project.outputs_of(step)
    if outputs is None:
        return None
    motion = project.fingerprint_of(step)
    return [motion, contents(outputs, f"recordings/{name}")] if outputs else [motion]


def _is_as_noted(project: Project, name: str, recording: Path) -> bool:
    outputs = project.outputs_of(f"record {name}")
    below = {key: one for key, one in (outputs or {}).items() if key.startswith(f"recordings/{name}/")}
    return not outputs or hold(project.folder, [recording], below)


def motion_log_path(project: Project, name: str) -> Path:
    """Return the path of a recording's motion log."""
    return project.folder / f"{name}.parquet"
