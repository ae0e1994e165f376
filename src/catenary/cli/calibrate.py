"""catenary extract, deploy, calibrate, demo: one project folder, step by step or in one go."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from catenary.cli.beside_robot import RobotAccess, deploy_beside, robot_of
from catenary.cli.fit import ModelOptions, Robot
from catenary.cli.gravity_source import GravityOptions
from catenary.cli.options import Accept, AsJson, MappingOptions, MendOptions, NodeName
from catenary.cli.out_files import out_path
from catenary.cli.project_options import (
    ArmNamespace,
    BegunFolder,
    ExcitationOptions,
    Folder,
    Hours,
    Seed,
    open_project,
    require_project,
    step_progress,
)
from catenary.cli.terminal import announce, print_json, print_notes, print_table, progress_bar
from catenary.errors import CatenaryError, InputError, InUseError

if TYPE_CHECKING:
    from catenary.workflows.project.calibrate import CalibrationResult


def extract(
    project: BegunFolder,
    bag: Annotated[str | None, Option(help="Also write bags: ros1 or mcap.")] = None,
    csv: Annotated[bool, Option("--csv", help="Also write the published 252-column CSV.")] = False,
    columns: Annotated[
        str | None,
        Option(
            metavar="NAME,...",
            help="Further columns of raven_state for the logs to carry, or all. [default: none]",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Extract and synchronise the project's recordings.

    Writes a motion log NAME.parquet for each, and a report beside it. Of a recording that was interrupted it takes
    what is whole, and says what is lost.
    """
    from catenary.recording.import_formats.raven_columns import write_raven_csv
    from catenary.workflows.project.recordings import extract_recording, motion_log_path, write_bags
    from catenary.workflows.project.robot import arm_of
    from catenary.workflows.project.state import ExtractionFile, read_state

    if bag not in (None, "ros1", "mcap"):
        raise InputError(f'--bag "{bag}": expected ros1 or mcap')
    require_project(project)
    opened = open_project(project, columns=columns)
    names = sorted(p.name for p in (opened.folder / "recordings").glob("*") if p.is_dir())
    if not names:
        raise InputError(f"{project}: holds no recordings; run catenary excite first")
    found, failed = dict[str, Any](), dict[str, CatenaryError]()
    for name in names:
        with step_progress(f"extract {name}"):
            try:
                extract_recording(opened, name)
            except CatenaryError as error:
                if isinstance(error, InUseError):
                    raise
                failed[name] = error
                continue
            report = read_state(
                opened.folder / f"{name}.synchronised.json",
                ExtractionFile,
                "delete it, and `catenary extract PROJECT` makes it again",
            )
            found[name] = {"log": str(motion_log_path(opened, name)), **report}
            if bag is not None:
                written = write_bags(opened, name, "ros1" if bag == "ros1" else "mcap")
                found[name]["bags"] = [str(path) for path in written]
            if csv:
                table = opened.folder / f"{name}.csv"
                write_raven_csv(opened.folder / "extracted" / name, table, arm=arm_of(opened))
                found[name]["csv"] = str(table)
    if as_json:
        print_json(found)
    for name, report in () if as_json else found.items():
        header = ["topic", "messages", "rate [Hz]", "longest gap [ms]"]
        rows = [
            [
                t["topic"],
                str(t["messages"]),
                "-" if t["rate"] is None else f"{t['rate']:.1f}",
                "-" if t["longest_gap"] is None else f"{1e3 * t['longest_gap']:.0f}",
            ]
            for t in report["topics"]
        ]
        print_table(f"{name}: {report['rows']} rows", header, rows)
        print_notes(report["problems"])
        print(f"log: {report['log']}\n")
    for name, failure in failed.items():
        if found and opened.outputs_of(f"record {name}") is None:
            print_notes([f"{name}: was interrupted, and is left out: {failure}"])
        else:
            raise failure


def deploy(
    model: Annotated[Path, Argument(metavar="MODEL", help="A calibration model of the project's robot.")],
    gravity: GravityOptions,
    project: Annotated[
        Path | None, Argument(metavar="PROJECT", help="Folder of the project; none with --ros.")
    ] = None,
    seconds: Annotated[float | None, Option(help="Duration. [default: 20; with --ros until Ctrl-C]")] = None,
    real_time: Annotated[bool, Option("--real-time/--fast", help="Keep time with the clock.")] = True,
    ros: Annotated[
        int | None, Option(metavar="1|2", help="Beside a robot on ROS: publish its messages corrected.")
    ] = None,
    arm: Annotated[str, Option(help="With --ros: gold (left) or green.")] = "gold",
    dialect: Annotated[
        str | None, Option(help="With --ros: raven or crtk. [default: raven; of a dVRK PSM crtk]")
    ] = None,
    namespace: ArmNamespace = None,
    rate: Annotated[float, Option(metavar="HZ", help="With --ros: rate of the robot's messages.")] = 1000.0,
    name: NodeName = None,
    no_mend: Annotated[
        bool, Option("--no-mend", help="The robot reports as the model's training data were mended to be.")
    ] = False,
    gravity_torque: Annotated[
        bool,
        Option("--gravity-torque", help="With --ros: also publish the torques that hold the joints still."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Run a model in a robot's loop, or beside one on ROS.

    Prints latency, the share of time in the valid range, and the error while it runs.
    """
    source = gravity.source(ros)
    if ros is not None:
        if project is not None:
            raise InputError("--ros: works beside whatever moves the robot; give no project")
        deploy_beside(
            model, ros, mends=not no_mend, name=name, arm=arm, dialect=dialect, namespace=namespace,
            seconds=float("inf") if seconds is None else seconds, rate_hz=rate,
            gravity_torque=gravity_torque, imu=source, as_json=as_json,
        )  # fmt: skip
        return
    if project is None:
        raise InputError("deploy: give the folder of a project, or --ros 1 for a robot")
    seconds = 20.0 if seconds is None else seconds
    from catenary.calibration.model_file import load_model
    from catenary.config import plain_data
    from catenary.simulation.plant_state import restore_plant
    from catenary.workflows.project.calibrate import TRAIN, random_motion
    from catenary.workflows.project.deploy import deploy_on_robot
    from catenary.workflows.project.robot import left_at, make_plant

    loaded, _ = load_model(model)
    loaded = replace(loaded, mends={}) if no_mend else loaded
    require_project(project)
    opened = open_project(project)
    plant = make_plant(opened.settings)
    left = left_at(opened, TRAIN)
    restore_plant(plant, left if left.is_file() else left_at(opened, "home"))
    plant.state_command("enable")
    motion, _ = random_motion(opened, seconds, 1)
    with step_progress(f"{seconds:g} s at 1 kHz"):
        result = deploy_on_robot(plant, loaded, motion, real_time=real_time)
    if as_json:
        print_json(plain_data(result))
        return
    print(result.loop)
    rows = [[each.name, each.unit, f"{each.raw_rmse:.3f}", f"{each.rmse:.3f}"] for each in result.joints]
    header = ["joint", "unit", "reported", "corrected"]
    if result.coverage_asked is not None:
        header.append(f"within intervals ({result.coverage_asked:.0%} asked)")
        rows = [[*row, f"{each.coverage:.0%}"] for row, each in zip(rows, result.joints, strict=True)]
    print_table("RMSE while the loop ran", header, rows)


def calibrate(
    project: Folder,
    arm: ExcitationOptions,
    fitting: ModelOptions,
    mending: MendOptions,
    access: RobotAccess,
    foreign: MappingOptions,
    train: Annotated[
        list[Path] | None, Argument(metavar="[DATA...]", help="Recordings to train on, in place of a robot.")
    ] = None,
    test: Annotated[list[Path] | None, Option(metavar="DATA", help="Test recording; repeatable.")] = None,
    hours: Hours = None,
    robot: Robot = None,
    accept: Accept = None,
    namespace: ArmNamespace = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate a robot in one go, from homing to a report.

    Home, excite, record, extract, fit, evaluate, deploy, report; done steps are not repeated. Without recordings
    it drives a simulated RAVEN-II, or with --robot dvrk_psm a da Vinci PSM, and with --ros a real one; with them it
    fits every model to them and tests on --test.
    The options of fit are those of the model that is recommended and deployed; --seed is also that of its training.
    """
    from catenary.robots.catalog import load_robot
    from catenary.workflows.project.calibrate import calibrate_recordings, calibrate_robot

    if test and not train:
        raise InputError("--test: goes with recordings to train on; without them the robot records its own")
    asked, run = fitting.options(seed=0), fitting.run(accept, robot)
    loaded = None if robot is None or not train else load_robot(robot)
    names, units = (None, None) if loaded is None else (loaded.joint_names, loaded.joint_units)
    reading = mending.reading(foreign, units=units, joint_names=names, robot=robot)
    kind = None if train else robot
    opened = open_project(project, arm, hours=hours, ros=access.ros, robot=kind, namespace=namespace)
    with opened, _steps() as progress:
        if train:
            result = calibrate_recordings(
                opened,
                train,
                test or [],
                reading=reading,
                asked=asked,
                run=run,
                progress=progress,
            )
        else:
            with robot_of(opened, access, "calibrate") as moved:
                result = calibrate_robot(opened, moved, asked=asked, run=run, progress=progress)
    _conclude(result, as_json)


def demo(
    out: Annotated[
        Path,
        Option(
            metavar="FOLDER",
            parser=out_path,
            help="Folder for the results: a new or empty one, or that of a demo before.",
        ),
    ] = Path("demo"),
    seed: Seed = None,
    as_json: AsJson = False,
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
    if as_json:
        print_json(result.summary())
        return
    header, rows = result.table()
    print_table("RMSE on a recording that no model saw (per cent of the fixed offset)", header, rows)
    for sentence in result.advice:
        print(sentence)
    deployed = result.deployment
    if deployed is not None and deployed["compute_us"]:
        compute = deployed["compute_us"]
        overruns = "" if deployed["overruns"] is None else f", {deployed['overruns']} overruns"
        print(
            f"1 kHz loop: {deployed['ticks']} ticks, compute median {compute['median']:.1f} us, "
            f"p99.9 {compute['p999']:.0f} us{overruns}"
        )
    if not result.repeated:
        print("nothing to do: every step had been done")
    print(f"page:  {result.page}\nmodel: {result.model_path}")


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
