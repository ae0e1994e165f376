"""catenary extract, calibrate, demo: one project folder, step by step or in one go."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catenary.cli import projects
from catenary.cli.fit import ROBOT_OF_DATA, ModelOptions
from catenary.cli.options import AS_JSON, Names, argument, option
from catenary.cli.out_files import out_path
from catenary.cli.recording_options import ACCEPT, RecordingOptions
from catenary.cli.robot_choice import SIMULATED_SEED
from catenary.cli.terminal import announce, print_notes, print_result, progress_bar
from catenary.errors import CatenaryError, InputError, InUseError

if TYPE_CHECKING:
    from catenary.workflows.project.calibrate import CalibrationResult


def extract(
    project: Path = projects.BEGUN_FOLDER,
    bag: str | None = option("ros1|mcap", "Also write bags."),
    columns: Names | None = option("NAME,...", "Further columns of raven_state to keep, or all. [default: none]"),
    as_json: bool = AS_JSON,
) -> None:
    """Extract and synchronise the project's recordings.

    Writes a motion log NAME.parquet for each, and a report. Of an interrupted recording it keeps the
    intact part and reports the loss.
    """
    from catenary.reports.page import Column, Table
    from catenary.workflows.project.recordings import extract_recording, motion_log_path, write_bags

    gap = ("longest gap [ms]", lambda t: t["longest_gap"] and f"{1e3 * t['longest_gap']:.0f}")
    columns_of_topics: list[Column] = ["topic", "messages", ("rate [Hz]", "rate:.1f"), gap]
    projects.require_project(project)
    opened = projects.open_project(project, columns=columns)
    names = sorted(p.name for p in (opened.folder / "recordings").glob("*") if p.is_dir())
    if not names:
        raise InputError(f"{project}: holds no recordings; run catenary excite first")
    found, failed = dict[str, Any](), dict[str, CatenaryError]()
    for name in names:
        with progress_bar(f"extract {name}"):
            try:
                extract_recording(opened, name)
            except CatenaryError as error:
                if isinstance(error, InUseError):
                    raise
                failed[name] = error
                continue
            report = json.loads((opened.folder / f"{name}.synchronised.json").read_bytes())
            found[name] = {"log": str(motion_log_path(opened, name)), **report}
            if bag is not None:
                written = write_bags(opened, name, "ros1" if bag == "ros1" else "mcap")
                found[name]["bags"] = [str(path) for path in written]
    parts: list[Any] = []
    for name, report in found.items():
        parts.append(Table(columns_of_topics, report["topics"], f"{name}: {report['rows']} rows"))
        parts.append(f"log: {report['log']}\n")
    print_result(as_json, found, *parts, notes=[each for report in found.values() for each in report["problems"]])
    for name, failure in failed.items():
        if found and opened.outputs_of(f"record {name}") is None:
            print_notes([f"{name}: was interrupted and is left out: {failure}"])
        else:
            raise failure


def calibrate(
    arm: projects.ExcitationOptions,
    fitting: ModelOptions,
    recordings: RecordingOptions,
    access: projects.RobotAccess,
    project: Path = projects.FOLDER,
    train: Sequence[Path] = argument("[DATA...]", "Recordings to train on, in place of a robot.", None),
    test: Sequence[Path] = option("DATA", "Test recording; repeatable.", goes_with="train"),
    hours: float | None = replace(projects.HOURS, not_with="train"),
    robot: str | None = ROBOT_OF_DATA,
    accept: Sequence[str] = ACCEPT,
    namespace: str | None = projects.ARM_NAMESPACE,
    as_json: bool = AS_JSON,
) -> None:
    """Calibrate a robot in one go, from homing to a report.

    Home, excite, record, extract, fit, evaluate, deploy, report; done steps are not repeated. Without recordings
    it drives a simulated RAVEN-II, or with --robot dvrk_psm a da Vinci PSM, and with --ros a real one; with them it
    fits every model to them and tests on --test.
    The options of fit apply to the recommended and deployed model; --seed also seeds its training.
    """
    from catenary.workflows.project.calibrate import calibrate_recordings, calibrate_robot

    asked, run = fitting.options(seed=0), fitting.run(accept, robot)
    reading = recordings.reading(robot if train else None)
    kind = None if train else robot
    opened = projects.open_project(project, arm, hours=hours, ros=access.ros, robot=kind, namespace=namespace)
    with opened, _steps() as progress:
        if train:
            result = calibrate_recordings(opened, train, test, reading=reading, asked=asked, run=run, progress=progress)
        else:
            with projects.robot_of(opened, access, "calibrate") as moved:
                result = calibrate_robot(opened, moved, asked=asked, run=run, progress=progress)
    _conclude(result, as_json)


def demo(
    out: Path = option("FOLDER", "Folder to write; new, empty, or from an earlier demo.", Path("demo"), read=out_path),
    seed: int | None = SIMULATED_SEED,
    as_json: bool = AS_JSON,
) -> None:
    """Calibrate a simulated RAVEN-II in two minutes.

    A short zig-zag, a short test, the whole pipeline and a page.
    """
    from catenary.workflows.project.calibrate import calibrate_robot
    from catenary.workflows.project.folder import Project, ProjectSettings

    settings = ProjectSettings(seed=seed, sparsities=(1 / 2, 1 / 3), test_minutes=5.0)
    with _steps() as progress:
        result = calibrate_robot(Project(out, settings), progress=progress)
    _conclude(result, as_json)
    if not as_json:
        print(f"see it: {_this_command()} view {out}")


def _this_command() -> str:
    """Return what a shell calls this command: its path where it is not on the search path."""
    import shutil
    import sys

    return "catenary" if shutil.which("catenary") else sys.argv[0]


def _conclude(result: "CalibrationResult", as_json: bool) -> None:
    from catenary.reports.project import comparison_table, corrector_time

    title = "RMSE on a recording that no model saw (per cent of the fixed offset)"
    lines, deployed = [*result.advice], result.deployment
    if deployed is not None and deployed["compute_us"]:
        compute = deployed["compute_us"]
        lines += corrector_time(deployed)
        overruns = "" if deployed["overruns"] is None else f", {deployed['overruns']} overruns"
        robot = "simulated robot" if deployed["simulated"] else "robot"
        lines.append(
            f"1 kHz loop, reading and commanding the {robot} included: {deployed['ticks']} ticks, "
            f"median {compute['median']:.0f} us, p99.9 {compute['p999']:.0f} us{overruns}"
        )
    if not result.repeated:
        lines.append("nothing to do: every step is done already")
    lines.append(f"page:  {result.page}\nmodel: {result.model_path}")
    print_result(as_json, result.summary(), comparison_table(result.evaluations, title), *lines)


@contextmanager
def _steps() -> Iterator[Callable[[str], Callable[[float], None]]]:
    """Print a line per step on standard error as it begins, and in a terminal a bar for the one that runs."""
    begin = time.monotonic()
    with ExitStack() as bar:

        def step(name: str) -> Callable[[float], None]:
            bar.close()  # of the step before
            announce(f"[{time.monotonic() - begin:4.0f} s] {name}")
            return bar.enter_context(progress_bar(name))

        yield step
