"""Extract and synchronise a project's recordings into motion logs, whatever robot they are of."""

from pathlib import Path

from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.robot import arm_of, empty


def extract_recording(project: Project, name: str) -> bool:
    """Extract recordings/NAME and synchronise it into a motion log, NAME.parquet."""
    from catenary.recording.extract import extract
    from catenary.recording.logs import write_parquet
    from catenary.recording.synchronise import SynchroniseOptions, synchronise

    folder = project.folder / "extracted" / name
    path, report = motion_log_path(project, name), project.folder / f"{name}.synchronised.json"

    def work() -> None:
        empty(folder)
        extraction = extract([project.folder / "recordings" / name], folder)
        arm = SynchroniseOptions(arm=arm_of(project), columns=project.settings.columns)
        result = synchronise(folder, arm)
        write_parquet(result.log, path)
        found = {
            "topics": [vars(topic) | {"longest_gap": topic.longest_gap} for topic in result.topics],
            "stopped_encoders": [stop.note() for stop in result.stopped],
            "rows": len(result.log),
            "rows_without_encoder": result.without_encoder,
            "problems": list(extraction.problems),
        }
        write(report, found)

    made_from = [project.fingerprint_of(f"record {name}"), *project.settings.columns]
    return project.run(f"extract {name}", made_from, [path, report], work)


def motion_log_path(project: Project, name: str) -> Path:
    """Return the path of a recording's motion log."""
    return project.folder / f"{name}.parquet"
