"""catenary home, excite, record, extract, deploy, calibrate, demo: one project folder, step by step or in one go."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from catenary.cli.terminal import numbers, print_json, print_notes, print_table, progress_bar, words
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.jobs.calibrate import CalibrationResult
    from catenary.jobs.project import Project

Folder = Annotated[
    Path, typer.Argument(metavar="PROJECT", help="Folder of the project; made if it is not there.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Seed = Annotated[
    int | None,
    typer.Option("--seed", help="Draws another simulated robot of the kind. [default: the nominal one]"),
]
Tilt = Annotated[
    str | None,
    typer.Option("--base-tilt-deg", metavar="R,P", help="Roll about x, then pitch about y, of the base."),
]
Payload = Annotated[float | None, typer.Option("--payload", metavar="KG", help="Mass at the tool's wrist.")]
Side = Annotated[str | None, typer.Option("--side", help="left (gold) or right (green). [default: left]")]
Direction = Annotated[
    str | None, typer.Option("--direction", help="Of the zig-zag: J1, J2, J3, J1-J2, J2-J3, J1-J3, J1-J2-J3.")
]
Sparsity = Annotated[
    str | None, typer.Option("--sparsity", metavar="S,S,...", help="Of the zig-zags. [default: 1/2,1/3,1/4]")
]
StateRate = Annotated[
    float | None, typer.Option("--state-rate", metavar="HZ", help="Of raven_state, 30 or 100. [default: 30]")
]
Hours = Annotated[float | None, typer.Option("--hours", help="Length of the random motion.")]


def home(
    project: Folder,
    seed: Seed = None,
    base_tilt_deg: Tilt = None,
    payload: Payload = None,
    side: Side = None,
    as_json: AsJson = False,
) -> None:
    """Home the project's robot.

    Every axis runs into its stop, which registers its encoder.
    """
    from catenary.jobs.simulated_robot import home_robot

    opened = _open(project, seed, base_tilt_deg, payload, side)
    with _progress("homing"):
        was_run = home_robot(opened)
    _say(opened, "homed", was_run, as_json, _read(opened.folder / "robot" / "home.json"))


def excite(
    project: Folder,
    direction: Direction = None,
    sparsity: Sparsity = None,
    seed: Seed = None,
    base_tilt_deg: Tilt = None,
    payload: Payload = None,
    side: Side = None,
    state_rate: StateRate = None,
    as_json: AsJson = False,
) -> None:
    """Drive the robot along the calibration zig-zag and record it.

    Writes recordings/train; homes first if needed.
    """
    from catenary.jobs.calibrate import TRAIN, excitation
    from catenary.jobs.simulated_robot import home_robot, record_robot

    opened = _open(project, seed, base_tilt_deg, payload, side, direction, sparsity, None, state_rate)
    with _progress("homing"):
        home_robot(opened)
    motion, what = excitation(opened)
    with _progress("excite") as tell:
        was_run = record_robot(opened, TRAIN, motion, what, after="home", progress=tell)
    _say(
        opened, f"recorded {motion.duration:.0f} s as {TRAIN}", was_run, as_json, {"seconds": motion.duration}
    )


def record(
    project: Folder,
    hours: Hours = None,
    name: Annotated[str, typer.Option("--name", help="Of the recording.")] = "test",
    as_json: AsJson = False,
) -> None:
    """Drive the robot along a random motion and record it.

    Writes recordings/NAME; after `catenary excite`.
    """
    from catenary.jobs.calibrate import TRAIN, random_motion
    from catenary.jobs.simulated_robot import record_robot

    if not name.isidentifier() or name == TRAIN:
        raise InputError(f'--name "{name}": expected letters, digits and _, and another name than {TRAIN}')
    _require_project(project)
    opened = _open(project, hours=hours)
    seconds = 60.0 * opened.settings.test_minutes
    motion, what = random_motion(opened, seconds)
    with _progress("record") as tell:
        was_run = record_robot(opened, name, motion, what, after=TRAIN, progress=tell)
    _say(opened, f"recorded {seconds:.0f} s as {name}", was_run, as_json, {"seconds": seconds})


def extract(
    project: Folder,
    bag: Annotated[str | None, typer.Option("--bag", help="Also write bags: ros1 or mcap.")] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Also write the published 252-column CSV.")] = False,
    as_json: AsJson = False,
) -> None:
    """Extract and synchronise the project's recordings.

    Writes a motion log NAME.parquet for each, and a report beside it.
    """
    from catenary.jobs.project_recordings import extract_recording, motion_log_path
    from catenary.recording.bag import write_group_bags
    from catenary.recording.raven_csv import write_raven_csv
    from catenary.recording.source import open_recording

    if bag not in (None, "ros1", "mcap"):
        raise InputError(f'--bag "{bag}": expected ros1 or mcap')
    _require_project(project)
    opened = _open(project)
    names = sorted(p.name for p in (opened.folder / "recordings").glob("*") if p.is_dir())
    if not names:
        raise InputError(f"{project}: holds no recordings; run catenary excite first")
    found: dict[str, Any] = {}
    for name in names:
        with _progress(f"extract {name}"):
            extract_recording(opened, name)
            report = _read(opened.folder / f"{name}.synchronised.json")
            found[name] = {"log": str(motion_log_path(opened, name)), **report}
            if bag is not None:
                written = write_group_bags(
                    open_recording(opened.folder / "recordings" / name),
                    opened.folder / "bags" / name,
                    "ros1" if bag == "ros1" else "mcap",
                )
                found[name]["bags"] = [str(path) for path in written]
            if csv:
                table = opened.folder / f"{name}.csv"
                folder = opened.folder / "extracted" / name
                write_raven_csv(folder, table, arm="gold" if opened.settings.side == "left" else "green")
                found[name]["csv"] = str(table)
    if as_json:
        print_json(found)
        return
    for name, report in found.items():
        rows = [
            [t["topic"], str(t["messages"]), f"{t['rate']:.1f}", f"{1e3 * t['longest_gap']:.0f}"]
            for t in report["topics"]
        ]
        print_table(
            f"{name}: {report['rows']} rows", ["topic", "messages", "rate [Hz]", "longest gap [ms]"], rows
        )
        print_notes(report["problems"] + report["stopped_encoders"])
        print(f"log: {report['log']}\n")


def deploy(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="A calibration model of the project's robot.")
    ],
    project: Folder,
    seconds: Annotated[float, typer.Option("--seconds", help="How long the loop runs.")] = 20.0,
    real_time: Annotated[bool, typer.Option("--real-time/--fast", help="Keep time with the clock.")] = True,
    as_json: AsJson = False,
) -> None:
    """Run a model inside the robot's 1 kHz loop.

    Tells latency, valid range, and error while it runs.
    """
    from catenary.calibration.files import load_model
    from catenary.jobs.calibrate import TRAIN, random_motion
    from catenary.jobs.deploy import deploy_on_simulated
    from catenary.jobs.simulated_robot import make_plant
    from catenary.simulation.plant_state import restore_plant

    loaded, _ = load_model(model)
    _require_project(project)
    opened = _open(project)
    plant = make_plant(opened.settings)
    state = opened.folder / "robot" / f"after_{TRAIN}.npz"
    restore_plant(plant, state if state.is_file() else opened.folder / "robot" / "homed.npz")
    plant.state_command("enable")
    motion, _ = random_motion(opened, seconds, 1)
    with _progress(f"{seconds:g} s at 1 kHz"):
        result = deploy_on_simulated(plant, loaded, motion, real_time=real_time)
    if as_json:
        print_json(result.as_data())
        return
    print(result.loop)
    rows = [
        [name, unit, f"{raw:.3f}", f"{rmse:.3f}"]
        for name, unit, raw, rmse in zip(
            result.joint_names, result.units, result.raw_rmse, result.rmse, strict=True
        )
    ]
    print_table("RMSE while the loop ran", ["joint", "unit", "reported", "corrected"], rows)


def calibrate(
    project: Folder,
    train: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[DATA...]", help="Recordings to train on, in place of a robot."),
    ] = None,
    test: Annotated[
        list[Path] | None,
        typer.Option("--test", metavar="DATA", help="Recording to test on; may be repeated."),
    ] = None,
    units: Annotated[
        str | None,
        typer.Option("--units", metavar="U,U,...", help="rad or m per joint, where recordings do not say."),
    ] = None,
    direction: Direction = None,
    sparsity: Sparsity = None,
    hours: Hours = None,
    seed: Seed = None,
    base_tilt_deg: Tilt = None,
    payload: Payload = None,
    side: Side = None,
    state_rate: StateRate = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate a robot in one go, from homing to a report.

    Home, excite, record, extract, fit, evaluate, deploy, report; done steps are not repeated. Without recordings
    it drives a simulated RAVEN-II; with them it fits every model to them and tests on --test.
    """
    from catenary.jobs.calibrate import calibrate_recordings, calibrate_robot
    from catenary.jobs.calibration import FitRun

    opened = _open(project, seed, base_tilt_deg, payload, side, direction, sparsity, hours, state_rate)
    with _steps() as tell:
        if train:
            run = FitRun(units=words(units) if units else None)
            result = calibrate_recordings(opened, train, test or [], run, progress=tell)
        elif test:
            raise InputError(
                "--test: goes with recordings to train on; without, the simulated robot records its own"
            )
        else:
            result = calibrate_robot(opened, progress=tell)
    _conclude(result, as_json)


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Where to put the results.")] = Path(
        "demo"
    ),
    seed: Seed = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate a simulated RAVEN-II in two minutes.

    A short zig-zag, a short test, the whole pipeline and a page.
    """
    from catenary.jobs.calibrate import calibrate_robot
    from catenary.jobs.project import Project, ProjectSettings

    settings = ProjectSettings(seed=seed, sparsities=(1 / 2, 1 / 3), test_minutes=5.0)
    with _steps() as tell:
        result = calibrate_robot(Project(out, settings), progress=tell)
    _conclude(result, as_json)


def _conclude(result: "CalibrationResult", as_json: bool) -> None:
    if as_json:
        print_json(result.summary())
        return
    header, rows = result.table()
    print_table("RMSE on a recording that no model saw (per cent of the fixed offset)", header, rows)
    deployed = result.deployment
    if deployed is not None and deployed["compute_us"]:
        compute = deployed["compute_us"]
        print(
            f"1 kHz loop: {deployed['ticks']} ticks, compute median {compute['median']:.1f} us, "
            f"p99.9 {compute['p999']:.0f} us, {deployed['overruns']} overruns"
        )
    if not result.repeated:
        print("nothing to do: every step had been done")
    print(f"page:  {result.page}\nmodel: {result.model_path}")


def _open(
    folder: Path,
    seed: int | None = None,
    tilt: str | None = None,
    payload: float | None = None,
    side: str | None = None,
    direction: str | None = None,
    sparsity: str | None = None,
    hours: float | None = None,
    state_rate: float | None = None,
) -> "Project":
    """Open a project with the settings it has, changed by what was typed."""
    from catenary.jobs.project import Project, ProjectSettings, project_settings

    settings = project_settings(folder) or ProjectSettings()
    if tilt is not None:
        angles = numbers("--base-tilt-deg", tilt)
        if len(angles) != 2:
            raise InputError(f"--base-tilt-deg: expected roll,pitch in degrees, got {tilt!r}")
        settings = replace(settings, base_tilt_deg=(angles[0], angles[1]))
    if sparsity is not None:
        settings = replace(settings, sparsities=tuple(_fraction(word) for word in words(sparsity)))
    changes: dict[str, Any] = {"seed": seed, "payload_kg": payload, "side": side, "direction": direction}
    changes["state_rate_hz"] = state_rate
    changes["test_minutes"] = None if hours is None else 60.0 * hours
    return Project(
        folder, replace(settings, **{key: value for key, value in changes.items() if value is not None})
    )


def _require_project(folder: Path) -> None:
    """Refuse a folder in which nothing was begun, so that a mistyped name makes no new project."""
    from catenary.jobs.project import SETTINGS

    if not (folder / SETTINGS).is_file():
        raise InputError(f"{folder}: is no project; begin one with catenary home, excite or calibrate")


def _fraction(text: str) -> float:
    upper, _, lower = text.partition("/")
    try:
        value = float(upper) / float(lower) if lower else float(upper)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"--sparsity: expected numbers such as 1/2 or 0.5, got {text!r}") from None
    return value


def _say(project: "Project", what: str, was_run: bool, as_json: bool, content: Any) -> None:
    if as_json:
        print_json({"project": str(project.folder), "run": was_run, **content})
    else:
        print(f"{project.folder}: {what}" + ("" if was_run else " before; nothing to do"))


def _read(path: Path) -> Any:
    import json

    return json.loads(path.read_text(encoding="utf-8"))


@contextmanager
def _progress(label: str) -> Iterator[Callable[[float], None]]:
    with progress_bar(label) as tell:
        yield tell


@contextmanager
def _steps() -> Iterator[Callable[[str], Callable[[float], None]]]:
    """A line per step on standard error as it begins, and in a terminal a bar for the one that runs."""
    import sys
    import time

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    begin = time.monotonic()
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def step(name: str) -> Callable[[float], None]:
            if console.is_terminal:
                console.print(f"[{time.monotonic() - begin:4.0f} s] {name}", markup=False)
            else:
                print(f"[{time.monotonic() - begin:4.0f} s] {name}", file=sys.stderr, flush=True)
            bar.reset(task, total=None, description=name)
            return lambda done: bar.update(task, total=1.0, completed=done)

        yield step
