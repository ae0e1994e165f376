"""catenary extract, calibrate, demo, deploy: one project folder, step by step or in one go; a model in a loop."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from catenary.cli import projects
from catenary.cli.exit_codes import FAULT_FOUND
from catenary.cli.fit import ROBOT_OF_DATA, ModelOptions
from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import Names, argument, group, option, values_of
from catenary.cli.out_files import out_path
from catenary.cli.projects import ARM_NAMESPACE, open_project, require_project
from catenary.cli.recording_options import ACCEPT, OWN_CLASS, RecordingOptions
from catenary.cli.robot_options import DIALECT, NODE_NAME, SIMULATED_SEED
from catenary.cli.terminal import announce, print_notes, print_result, prints_json, progress_bar
from catenary.errors import CatenaryError, InputError, InUseError
from catenary.tables import Column, Table

if TYPE_CHECKING:
    from catenary.calibration.model import CalibrationModel
    from catenary.crtk.reader import CrtkReader
    from catenary.nodes.calibrated_topics import CalibratedTopics, WireReport
    from catenary.workflows.project.calibrate import CalibrationResult


def extract(
    project: Path = projects.BEGUN_FOLDER,
    bag: str | None = option("ros1|mcap", "Also write bags."),
    columns: Names | None = option("NAME,...", "Further columns of raven_state to keep, or all. [default: none]"),
) -> None:
    """Extract and synchronise the project's recordings.

    Writes a motion log NAME.parquet for each, and a report. Of an interrupted recording it keeps the
    intact part and reports the loss.
    """
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
    print_result(found, *parts, notes=[problem for report in found.values() for problem in report["problems"]])
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
            with projects.project_robot(opened, access, "calibrate") as moved:
                result = calibrate_robot(opened, moved, asked=asked, run=run, progress=progress)
    _conclude(result)


def demo(
    out: Path = option("FOLDER", "Folder to write; new, empty, or from an earlier demo.", Path("demo"), read=out_path),
    seed: int | None = SIMULATED_SEED,
) -> None:
    """Calibrate a simulated RAVEN-II in two minutes.

    A short zig-zag, a short test, the whole pipeline and a page.
    """
    from catenary.workflows.project.calibrate import calibrate_robot
    from catenary.workflows.project.folder import Project, ProjectSettings

    settings = ProjectSettings(seed=seed, sparsities=(1 / 2, 1 / 3), test_minutes=5.0)
    with _steps() as progress:
        result = calibrate_robot(Project(out, settings), progress=progress)
    _conclude(result)
    if not prints_json():
        print(f"see it: catenary view {out}")


def _conclude(result: "CalibrationResult") -> None:
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
    print_result(result.summary(), comparison_table(result.evaluations, title), *lines)


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


@group
class DeployedOnRos:
    """Options of a robot on ROS whose messages a model corrects."""

    ros: int | None = option("1|2", "With a robot on ROS: publish its corrected messages.", joins_ros=True)
    arm: str = option("gold|green", "With --ros: left or right.", "gold", goes_with="ros")
    dialect: str | None = DIALECT
    gravity: str | None = GRAVITY_TOPIC
    namespace: str | None = replace(ARM_NAMESPACE, goes_with="ros")
    rate: float = option("HZ", "With --ros: rate of the robot's messages.", 1000.0, goes_with="ros")
    name: str | None = replace(NODE_NAME, goes_with="ros")
    gravity_torque: bool = option(None, "With --ros: also publish gravity torques.", False, goes_with="ros")
    for_control: bool = option(None, "With --ros: for a controller of the corrected positions.", False, goes_with="ros")

    def run(self, model: "CalibrationModel", seconds: float) -> "tuple[WireReport, BaseException | None]":
        """Correct a robot's messages for so long; return how it went, and by which error it ended."""
        from catenary.crtk.network import make_transport, node_name
        from catenary.nodes.calibrated_topics import CalibratedTopics, reader_of

        if self.gravity_torque and self.gravity is None:
            print_notes(["gravity torques are those of a level base; --gravity gives another"])
        robot = values_of(self, "dialect", "namespace", "gravity")
        topics_of = {"rate_hz": self.rate, **values_of(self, "gravity_torque", "for_control")}
        with (
            make_transport(str(self.ros), node_name("deploy", self.name)) as transport,
            reader_of(model.joint_names, transport, self.arm, **robot) as client,
        ):
            topics = CalibratedTopics(client, model, **topics_of)
            failure: BaseException | None = None
            try:
                _tell_while_deployed(topics, client, seconds)
            except KeyboardInterrupt:
                pass  # the usual end
            except BaseException as error:
                failure = error
            report = topics.report()
            topics.close()
        return report, failure


def deploy(
    wire: DeployedOnRos,
    model: Path = argument("MODEL", "Calibration model of the project's robot."),
    project: Path | None = argument("PROJECT", "Its folder; not with --ros.", None, not_with=("ros", "ros_distro")),
    seconds: float | None = option(None, "Duration. [default: 20; with --ros until Ctrl-C]"),
    real_time: bool = option(None, "Run in real time, not faster.", True, flag="--real-time/--fast", not_with="ros"),
    as_is: bool = option(None, "The robot's reports are already corrected: use them unchanged.", False),
    own: str | None = OWN_CLASS,
) -> None:
    """Run a model in a robot's loop, or next to a robot on ROS.

    Prints latency, the share of time in the valid range, and the error while it runs. The exit code is 1 when it takes
    longer than a tick in the median.
    """
    if wire.ros is None and project is None:
        raise InputError("deploy: expected a model and its project's folder, or a model and --ros 1 or 2")
    if wire.ros is not None and seconds is not None and not seconds > 0.0:
        raise InputError(f"--seconds: expected more than 0, got {seconds}")
    from catenary.calibration.model_file import load_model

    loaded, _ = load_model(model, own)
    loaded = replace(loaded, mends={}) if as_is else loaded
    if project is not None:
        _in_a_loop(project, loaded, 20.0 if seconds is None else seconds, real_time=real_time)
        return
    report, failure = wire.run(loaded, float("inf") if seconds is None else seconds)
    _show_deployment(model, wire.arm, report)
    if failure is not None:
        raise failure  # after the report
    if not report.keeps_up and report.latency is not None and report.rate_hz is not None:
        _too_slow(report.latency.median, 1.0 / report.rate_hz)


def _too_slow(took: float, period: float) -> None:
    """End with exit code 1: what takes longer than its tick [s] is no loop."""
    announce(
        f"error: the model does not keep up: {1e3 * took:.2f} ms in the median, expected at most the "
        f"{1e3 * period:.2f} ms from one message to the next"
    )
    raise typer.Exit(FAULT_FOUND)


def _in_a_loop(project: Path, model: "CalibrationModel", seconds: float, *, real_time: bool) -> None:
    from catenary.config import plain_data
    from catenary.reports.project import corrector_time, deployed_table
    from catenary.simulation.firmware_plant import restore_plant
    from catenary.workflows.project.calibrate import TRAIN, evaluation_motion
    from catenary.workflows.project.kinds import project_kind
    from catenary.workflows.project.robot import deploy_on_robot, left_at

    require_project(project)
    opened = open_project(project)
    plant = project_kind(opened.settings).plant()
    left = left_at(opened, TRAIN)
    restore_plant(plant, left if left.is_file() else left_at(opened, "home"))
    plant.state_command("enable")
    motion, _ = evaluation_motion(opened, seconds, 1)
    with progress_bar(f"{seconds:g} s at 1 kHz"):
        result = deploy_on_robot(plant, model, motion, real_time=real_time)
    took = None if result.compute_us is None or not real_time else result.compute_us["median"]
    content = plain_data(result)
    table = deployed_table(content, title="RMSE while the loop ran")
    print_result(content, str(result.loop), *corrector_time(content), table)
    if took is not None and took > 1e6 * plant.period:
        _too_slow(1e-6 * took, plant.period)


_OVER = {"silence": "the robot is back", "fault": "its fault is over", "stale": "its inputs are back"}


def _tell_while_deployed(topics: "CalibratedTopics", client: "CrtkReader", seconds: float) -> None:
    transport = client.transport
    end, said = transport.steady() + seconds * 1e9, dict[str, str]()
    while (left := (end - transport.steady()) * 1e-9) > 0.0:
        topics.run(min(0.5, left))
        now = {
            "silence": "the robot is silent" if topics.is_silent else "",
            "fault": f"the robot is in FAULT: {client.fault_reason}" if client.fault_reason else "",
            "stale": f"stale input: {topics.stale[0].partition(':')[0]}" if topics.stale else "",
        }
        for kind, text in now.items():
            if text != said.get(kind, ""):
                announce(text or _OVER[kind])
        said = now


def _show_deployment(model: Path, arm: str, report: "WireReport") -> None:
    rate = "-" if report.rate_hz is None else f"{report.rate_hz:.1f} Hz"
    corrected = (
        f"{report.published} of {report.messages} messages corrected in {report.seconds:.1f} s, {rate}; "
        f"{report.late} late, {report.missed} missed, {report.not_homed} while not homed, "
        f"{report.unreadable} unreadable, {report.stale} with a stale input"
    )
    silences = f"silences: {report.silences}, the longest {report.longest_silence:.2f} s"
    latency = None
    if report.latency is not None:
        row = ["arrival to publication [us]", *(f"{1e6 * value:.0f}" for value in report.latency)]
        latency = Table(["", "median", "p99", "p99.9", "largest"], [row], "Latency")
    shares = [*zip(report.joint_names, report.outside, strict=True)]
    outside = Table(["joint", ("share", ":.1f %")], shares, "Messages outside the valid range")
    content = {"model": str(model), "arm": arm, **report.as_data()}
    print_result(content, corrected, silences, latency, outside)
