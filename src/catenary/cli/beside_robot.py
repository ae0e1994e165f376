"""Commands on a robot that is reached over ROS: which one, who stands beside it, a model at work there."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.terminal import announce, print_json, print_notes, print_table
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.gravity_topic import ImuTopic
    from catenary.crtk.reader import CrtkReader
    from catenary.crtk.transport import Transport
    from catenary.nodes.calibrated_topics import CalibratedTopics, WireReport
    from catenary.workflows.project.folder import Project
    from catenary.workflows.project.robot import ProjectRobot
    from catenary.workflows.robot.topic_recorder import RecordedTopics


@dataclass(frozen=True)
class RobotAccess:
    """Options of a project's robot: where it is, and whether a person beside it is asked."""

    ros: Annotated[
        int | None,
        Option(metavar="1|2", help="Robot on ROS 1 or 2. [default: the project's, simulated at first]"),
    ] = None
    yes: Annotated[
        bool, Option("--yes", help="With --ros: do not ask; the robot's state must permit each step.")
    ] = False
    simulated: Annotated[
        bool, Option("--simulated", help="With --ros: that robot is a simulation; recordings say so.")
    ] = False


class TerminalGuide:
    """Asks in the terminal; Enter says that it is done, q gives up."""

    def say(self, text: str) -> None:
        """Show a message."""
        announce(text)

    def confirm(self, text: str) -> bool:
        """Wait for Enter."""
        print(f"{text}\n  [Enter] done   [q] give up: ", end="", file=sys.stderr, flush=True)
        answer = sys.stdin.readline()
        return answer != "" and answer.strip().lower() not in ("q", "quit", "n", "no")


@contextmanager
def ros_transport(version: int, name: str) -> "Iterator[Transport]":
    """Open a transport on ROS 1 or 2."""
    from catenary.crtk.network import make_transport

    if version not in (1, 2):
        raise InputError(f"--ros {version}: expected 1 or 2")
    with make_transport(str(version), name) as transport:
        yield transport


@contextmanager
def robot_of(project: "Project", access: RobotAccess, command: str) -> "Iterator[ProjectRobot]":
    """Open the robot that a project is about, for a command: its simulated one, or one on ROS."""
    from catenary.crtk.network import node_name
    from catenary.workflows.project.robot import RosRobot, SimulatedRobot
    from catenary.workflows.robot.homing import AnswerYes

    connection = project.settings.connection
    if connection == "simulation":
        if access.yes or access.simulated:
            raise InputError("--yes and --simulated go with --ros; this project's robot is simulated here")
        yield SimulatedRobot()
        return
    guide = AnswerYes(announce) if access.yes else TerminalGuide()
    with ros_transport(int(connection.removeprefix("ros")), node_name(command)) as transport:
        yield RosRobot(transport, guide, simulated=access.simulated)


def record_others(
    project: "Project",
    name: str,
    seconds: float,
    *,
    ros: int,
    simulated: bool,
    progress: Callable[[float], None],
) -> "RecordedTopics":
    """Record a robot that somebody else moves."""
    from catenary.crtk.network import node_name
    from catenary.recording.journal import About
    from catenary.workflows.project.kinds import kind_of
    from catenary.workflows.robot.topic_recorder import record_topics

    kind = kind_of(project.settings)
    topics = kind.topics
    folder = project.folder / "recordings" / name
    recorded: list[RecordedTopics] = []
    if any(folder.glob("*")):
        raise InputError(f"{folder}: holds a recording already; give this one another --name")
    about = About(robot=kind.recorded_as, simulated=simulated, configuration={"motion": "not ours"})

    def work() -> None:
        with ros_transport(ros, node_name("record")) as transport:
            recorded.append(
                record_topics(
                    transport, folder, topics, seconds, about=about, progress=progress,
                    required=[topic.name for topic in kind.required],
                )
            )  # fmt: skip

    motion = {"motion": "not ours", "seconds": seconds, "begun_ns": time.time_ns()}
    project.run(f"record {name}", motion, [folder], work)
    (ended,) = recorded
    print_notes([note for count in ended.counts if (note := count.note()) is not None])
    return ended


def deploy_beside(
    model: Path,
    ros: int,
    *,
    mends: bool = True,
    name: str | None = None,
    arm: str,
    dialect: str | None,
    namespace: str | None,
    seconds: float,
    rate_hz: float,
    gravity_torque: bool,
    imu: "ImuTopic | None",
    as_json: bool,
) -> None:
    """Correct a robot's messages as they come, and publish them corrected."""
    from catenary.calibration.model_file import load_model
    from catenary.crtk.network import node_name
    from catenary.nodes.calibrated_topics import CalibratedTopics, reader_of

    if arm not in ("gold", "green"):
        raise InputError(f'--arm "{arm}": expected gold or green')
    if not seconds > 0.0:
        raise InputError(f"--seconds: expected more than 0, got {seconds}")
    loaded, _ = load_model(model)
    loaded = loaded if mends else replace(loaded, mends={})
    if gravity_torque and imu is None:
        print_notes(["gravity torques are those of a level base; --gravity or --imu tell of another"])
    with (
        ros_transport(ros, node_name("deploy", name)) as transport,
        reader_of(
            loaded.joint_names, transport, arm, dialect=dialect, namespace=namespace, imu=imu
        ) as client,
    ):
        topics = CalibratedTopics(client, loaded, rate_hz=rate_hz, gravity_torque=gravity_torque)
        failure: BaseException | None = None
        try:
            _tell_while_deployed(topics, client, seconds)
        except KeyboardInterrupt:
            pass  # the usual end
        except BaseException as error:
            failure = error
        report = topics.report()
        topics.close()
    _show_deployment(model, arm, report, as_json=as_json)
    if failure is not None:
        raise failure  # behind the report, which is there whatever ended it


_OVER = {"silence": "the robot is back", "fault": "its fault is over", "stale": "the input is back"}


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
                announce(
                    text
                    or {"silence": "the robot is back", "fault": "its fault is over"}.get(
                        kind, "its inputs are back"
                    )
                )
        said = now


def _show_deployment(model: Path, arm: str, report: "WireReport", *, as_json: bool) -> None:
    if as_json:
        print_json({"model": str(model), "arm": arm, **report.as_data()})
        return
    rate = "-" if report.rate_hz is None else f"{report.rate_hz:.1f} Hz"
    print(
        f"{report.published} of {report.messages} messages corrected in {report.seconds:.1f} s, {rate}; "
        f"{report.late} late, {report.missed} missed, {report.not_homed} while not homed, "
        f"{report.unreadable} unreadable, {report.stale} with a stale input"
    )
    print(f"silences: {report.silences}, the longest {report.longest_silence:.2f} s")
    if report.latency is not None:
        rows = [["arrival to publication [us]", *(f"{1e6 * value:.0f}" for value in report.latency)]]
        print_table("Latency", ["", "median", "p99", "p99.9", "largest"], rows)
    shares = zip(report.joint_names, report.outside, strict=True)
    rows = [[name, f"{100.0 * share:.1f} %"] for name, share in shares]
    print_table("Messages outside the valid range", ["joint", "share"], rows)
