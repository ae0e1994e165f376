"""catenary deploy: run a calibration model in a simulated robot's loop, or next to a robot on ROS."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import AS_JSON, argument, option
from catenary.cli.projects import ARM_NAMESPACE, open_project, require_project
from catenary.cli.robot_choice import DIALECT, NODE_NAME
from catenary.cli.terminal import announce, print_notes, print_result, progress_bar
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.calibration.model import CalibrationModel
    from catenary.crtk.reader import CrtkReader
    from catenary.nodes.calibrated_topics import CalibratedTopics, WireReport


def deploy(
    model: Path = argument("MODEL", "Calibration model of the project's robot."),
    project: Path | None = argument("PROJECT", "Its folder; not with --ros.", None, not_with=("ros", "ros_distro")),
    seconds: float | None = option(None, "Duration. [default: 20; with --ros until Ctrl-C]"),
    real_time: bool = option(None, "Keep time with the clock.", True, flag="--real-time/--fast", not_with="ros"),
    ros: int | None = option("1|2", "With a robot on ROS: publish its corrected messages.", joins_ros=True),
    arm: str = option("gold|green", "With --ros: left or right.", "gold", goes_with="ros"),
    dialect: str | None = DIALECT,
    gravity: str | None = GRAVITY_TOPIC,
    namespace: str | None = replace(ARM_NAMESPACE, goes_with="ros"),
    rate: float = option("HZ", "With --ros: rate of the robot's messages.", 1000.0, goes_with="ros"),
    name: str | None = replace(NODE_NAME, goes_with="ros"),
    as_is: bool = option(None, "The robot's reports are corrected already: take them as they are.", False),
    gravity_torque: bool = option(None, "With --ros: also publish gravity torques.", False, goes_with="ros"),
    as_json: bool = AS_JSON,
) -> None:
    """Run a model in a robot's loop, or next to a robot on ROS.

    Prints latency, the share of time in the valid range, and the error while it runs. The exit code is 1 when it takes
    longer than a tick in the median.
    """
    if ros is None and project is None:
        raise InputError("deploy: expected a model and its project's folder, or a model and --ros 1 or 2")
    if ros is not None and seconds is not None and not seconds > 0.0:
        raise InputError(f"--seconds: expected more than 0, got {seconds}")
    from catenary.calibration.model_file import load_model

    loaded, _ = load_model(model)
    loaded = replace(loaded, mends={}) if as_is else loaded
    if project is not None:
        _in_a_loop(project, loaded, 20.0 if seconds is None else seconds, real_time=real_time, as_json=as_json)
        return
    from catenary.crtk.network import make_transport, node_name
    from catenary.nodes.calibrated_topics import CalibratedTopics, reader_of

    if gravity_torque and gravity is None:
        print_notes(["gravity torques are those of a level base; --gravity tells of another"])
    with (
        make_transport(str(ros), node_name("deploy", name)) as transport,
        reader_of(loaded.joint_names, transport, arm, dialect=dialect, namespace=namespace, gravity=gravity) as client,
    ):
        topics = CalibratedTopics(client, loaded, rate_hz=rate, gravity_torque=gravity_torque)
        failure: BaseException | None = None
        try:
            _tell_while_deployed(topics, client, float("inf") if seconds is None else seconds)
        except KeyboardInterrupt:
            pass  # the usual end
        except BaseException as error:
            failure = error
        report = topics.report()
        topics.close()
    _show_deployment(model, arm, report, as_json=as_json)
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
    raise typer.Exit(1)


def _in_a_loop(project: Path, model: "CalibrationModel", seconds: float, *, real_time: bool, as_json: bool) -> None:
    from catenary.config import plain_data
    from catenary.reports.project import corrector_time, deployed_table
    from catenary.simulation.plant_state import restore_plant
    from catenary.workflows.project.calibrate import TRAIN, random_motion
    from catenary.workflows.project.deploy import deploy_on_robot
    from catenary.workflows.project.kinds import kind_of
    from catenary.workflows.project.robot import left_at

    require_project(project)
    opened = open_project(project)
    plant = kind_of(opened.settings).plant()
    left = left_at(opened, TRAIN)
    restore_plant(plant, left if left.is_file() else left_at(opened, "home"))
    plant.state_command("enable")
    motion, _ = random_motion(opened, seconds, 1)
    with progress_bar(f"{seconds:g} s at 1 kHz"):
        result = deploy_on_robot(plant, model, motion, real_time=real_time)
    took = None if result.compute_us is None or not real_time else result.compute_us["median"]
    content = plain_data(result)
    table = deployed_table(content, title="RMSE while the loop ran")
    print_result(as_json, content, str(result.loop), *corrector_time(content), table)
    if took is not None and took > 1e6 * plant.period:
        _too_slow(1e-6 * took, plant.period)


_OVER = {"silence": "the robot is back", "fault": "its fault is over", "stale": "its inputs are back"}


def _tell_while_deployed(topics: "CalibratedTopics", client: "CrtkReader", seconds: float) -> None:
    """Run a deployed model, and say what changes: the robot's silence, its faults, stale inputs."""
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


def _show_deployment(model: Path, arm: str, report: "WireReport", *, as_json: bool) -> None:
    from catenary.reports.page import Table

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
    print_result(as_json, content, corrected, silences, latency, outside)
