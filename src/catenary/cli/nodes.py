"""catenary serve, button, encoders, gravity-node, tool-node: simulated robots and devices as topics."""

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli.exit_codes import FAULT_FOUND
from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE, MOUNTING_FILE, ReadingOptions, SensingOptions
from catenary.cli.options import REQUIRED, Triple, group, json_help, option, require_one, values_of
from catenary.cli.out_files import TOOL, refuse_outputs
from catenary.cli.recording_options import ACCEPT
from catenary.cli.robot_options import CARRIER, SIMULATED_SEED, NodeOptions
from catenary.cli.terminal import announce, if_read, print_json_line, print_notes, print_result, prints_json
from catenary.crtk.dialects import DIALECTS
from catenary.errors import InputError
from catenary.units import in_words

if TYPE_CHECKING:
    from catenary.nodes.sensor_nodes import EncoderStatus, GravityStatus, SteppedNode
    from catenary.nodes.serve import ServerStatus, Serving
    from catenary.nodes.tool_node import ToolStatus

_prints_json_lines = json_help("Print a JSON line a second, and one at the end.")
_DURATION = option("S", "How long to run. [default: until Ctrl-C]", min=0.0)


@group
class ServedRobot:
    """Options of the robot that is served."""

    robot: str = option("ROBOT", "raven2, or of a dVRK dvrk_psm, dvrk_mtm or dvrk_ecm.", "raven2")
    dialect: str | None = option("|".join(DIALECTS), "Dialect of the topics. [default: the robot's own]")
    namespace: str | None = option("/NAME", "Namespace of a dVRK arm's topics. [default: /PSM1, /MTMR, /ECM]")
    seed: int | None = SIMULATED_SEED
    base_tilt_deg: tuple[float, float] = replace(BASE_TILT, default=LEVEL_BASE)
    payload: float = option("KG", "Mass at the tool's wrist.", 0.0)
    green: bool = option(None, "Move the green arm too; otherwise it is parked.", False)
    homed: bool = option(None, "Start homed; homing takes half a minute.", False)
    encoders: bool = option(
        None, "Publish external encoders of a RAVEN-II, a tracker of a PSM.", True, flag="--encoders/--no-encoders"
    )
    grav_dir: Triple | None = option("X,Y,Z", "Gravity for the robot's own compensation, in whole cm/s2, z down.")

    def serving(self) -> "Serving":
        """Return the served robot."""
        from catenary.nodes.serve import Serving
        from catenary.open_robot import Simulated, tilted_base

        is_raven = self.robot == "raven2"
        if is_raven and self.namespace is not None:
            raise InputError("--namespace: a RAVEN-II has none; its arms are /arm1 and /arm2")
        dialect: Any = self.dialect or ("raven" if is_raven else "crtk")
        base = tilted_base(self.base_tilt_deg)
        simulated = Simulated(self.seed, base, self.payload, homed=self.homed, grav_dir=self.grav_dir)
        return Serving(self.robot, dialect, simulated, self.green, self.encoders, namespace=self.namespace)


@_prints_json_lines
def serve(
    served: ServedRobot,
    ros: str = CARRIER,
    name: str = option("NAME", "Name of the robot's ROS node; it must be unique.", "catenary_robot"),
    rate: float = option("HZ", "Rate at which its state is published.", 1000.0),
    depth: int = option("N", "Queue length per topic for clients that do not keep up.", 100, min=1),
    qos: str = option("reliable|best-effort", "On ROS 2: quality of service of frequent topics.", "reliable"),
    start: bool = option(None, "Press the silver button at once; with crtk: enable and home.", False),
    duration: float | None = _DURATION,
) -> None:
    """Serve a simulated robot over ROS, in real time.

    `catenary button` presses the silver button of a RAVEN-II.

    Example: catenary serve --ros none --homed --duration 2
    Example: catenary serve --robot dvrk_psm --namespace /PSM1
    """
    if qos != "reliable" and ros != "2":
        raise InputError("--qos best-effort: goes with --ros 2; ROS 1 loses nothing on the way")
    announce("preparing the robot, half a minute the first time on a machine ...")  # imports alone take seconds
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.transport import Sending
    from catenary.nodes.serve import make_server, prepare_server
    from catenary.nodes.serve import serve as run

    # what it reports is in the status, which is shown; Python would print it a second time
    logging.getLogger("catenary.crtk.serving.reports").addHandler(logging.NullHandler())
    serving = served.serving()
    with make_transport(ros, node_name("robot", name)) as transport:
        transport.sending = Sending(depth, qos == "reliable")
        # an entry of one that crashed may have to lapse
        server = make_server(serving, transport, rate_hz=rate)
        prepare_server(server)
        where = {"1": "over ROS 1", "2": "over ROS 2", "none": "without ROS: no other program receives them"}[ros]
        pressed = "" if server.button is None else "; `catenary button` presses the silver button"
        print_notes(
            [f"serving {server.published} topics in dialect {serving.dialect} {where}; Ctrl-C ends it{pressed}"]
        )
        final = run(server, start=start, show=if_read(_show_json if prints_json() else _show), duration=duration)
    arms = ", ".join(f"{name} {text}" for name, text in final.states.items())
    print_notes([f"ended by {final.ended_by or 'its duration'}: {arms}"])
    if prints_json():
        _show_json(final, final=True)
        return
    print(
        f"{final.seconds:.1f} s at {final.rate_hz:.0f} Hz, {100 * final.cpu:.0f} % of a core; ticks lost: "
        f"{final.lost_ticks}; messages that clients missed: {final.overflowed}"
        + "".join(f", {count} of {client}" for client, count in sorted(final.missed.items()))
    )


def button(network: NodeOptions) -> None:
    """Press the silver button of a served RAVEN-II: it homes."""
    from catenary.crtk.client import press_button

    with network.joined("button") as transport:
        success, message = press_button(transport)
    print_result({"success": success, "message": message}, message)
    if not success:
        raise typer.Exit(FAULT_FOUND)


def _show(status: "ServerStatus") -> None:
    arms = ", ".join(f"{name} {text}" for name, text in status.states.items())
    line = (
        f"{status.seconds:7.0f} s  {status.rate_hz:5.0f} Hz  {100 * status.cpu:3.0f} % cpu  {arms}  "
        f"{status.commands_hz:.0f} commands/s of {status.clients} programs"
    )
    wrong = {
        f"  {status.lost_ticks} ticks lost": status.lost_ticks,
        f"  {status.overflowed} messages missed by {', '.join(sorted(status.missed))}": status.overflowed,
        "  NO MASTER": not status.is_up,
    }
    print(line + "".join(text for text, is_so in wrong.items() if is_so), flush=True)
    print_notes(status.warnings)


def _show_json(status: "ServerStatus", *, final: bool = False) -> None:
    print_json_line(status._asdict() | {"final": final})


@_prints_json_lines
def encoders(
    network: NodeOptions,
    port: str = option("PORT", "Serial port, as /dev/ttyUSB0.", REQUIRED),
    bits: int = option("16|24|32", "Width of the board's counters.", 32),
    direction: Triple = option("D,D,D", "-1 for an encoder that counts against its joint.", (1.0, 1.0, 1.0)),
    state: str = option("TOPIC", "Topic of the homing robot's operating state.", "/arm1/operating_state"),
    duration: float | None = _DURATION,
) -> None:
    """Publish the counts and positions of joint encoders.

    Topics: joint_enc (counts) and, once registered, ext_jpos (rad, rad, m). Home the robot while this runs: its
    stops register the encoders. The exit code is 1 when positions were not valid at the end.

    Example: catenary encoders --port /dev/ttyUSB0 --ros 1
    """
    import numpy as np

    from catenary.devices.encoder_board import EncoderBoard, EncoderRig
    from catenary.nodes.sensor_nodes import RATE, EncoderNode

    rig = EncoderRig(bits=bits, direction=np.array(direction))
    with network.joined("encoders") as transport, EncoderBoard(port, rig) as board:
        board.wait_ready()
        node = EncoderNode(board, transport, state_topic=state)
        print_notes([f"{port}: counts come; home the robot, and its stops register the encoders"])
        final = _run(node, _encoder_line, RATE, duration)
    if not final.reading.is_valid:
        raise typer.Exit(FAULT_FOUND)


@group
class GravitySensor:
    """Options of the sensor that is listened to: one of three topics, or a board."""

    imu: str | None = option("TOPIC", "A sensor_msgs/Imu, as /imu/data_raw.")
    accel: str | None = option("TOPIC", "A geometry_msgs/AccelStamped.")
    vector: str | None = option("TOPIC", "A geometry_msgs/Vector3Stamped.")
    port: str | None = option("PORT", "Serial port of an accelerometer board.")
    points_down: bool = option(None, "The topic's vectors are gravity, not specific force.", False, not_with="port")
    no_gyroscope: bool = option(None, "Ignore the IMU's angular rates.", False)

    def topic(self) -> tuple[str, str]:
        """Return the topic's name and type."""
        from catenary.crtk.gravity_topic import GRAVITY_TYPES

        topics = zip((self.imu, self.accel, self.vector), GRAVITY_TYPES, strict=True)
        return next((name, kind) for name, kind in topics if name is not None)


@group
class GravityOutputs:
    """Options of what is published."""

    rate: float = option("HZ", "Rate at which gravity is published.", 100.0)
    topic: str = option("TOPIC", "Topic that gravity is published on.", "/gravity")
    frame: str | None = option("NAME", "frame_id of the published gravity. [default: the mounting's base]")
    delta_of: str | None = option("ROBOT", "Also publish torques to add to its level-base firmware: TOPIC/delta.")
    joints: str = option("TOPIC", "Joints of --delta-of, a sensor_msgs/JointState.", "/joint_states")
    urscript: str | None = option("TOPIC", "Also set gravity on a Universal Robot, by its driver's script topic.")


@_prints_json_lines
def gravity_node(
    sensor: GravitySensor,
    sensing: SensingOptions,
    reading: ReadingOptions,
    published: GravityOutputs,
    network: NodeOptions,
    mounting: Path | None = MOUNTING_FILE,
    duration: float | None = _DURATION,
) -> None:
    """Publish gravity as a sensor on the base measures it.

    The exit code is 1 when no sample was valid.

    Example: catenary gravity-node --ros 1 --imu /imu/data_raw --mounting mounting.toml
    """
    from catenary.crtk.gravity_topic import GravityTopic
    from catenary.crtk.transforms import heard_pose
    from catenary.devices.accelerometer import SerialAccelerometer
    from catenary.nodes.sensor_nodes import GravityNode, LevelBaseArm
    from catenary.sensing.gravity_vector import Mailbox
    from catenary.sensing.mounting import Mounting, load_mounting
    from catenary.topics import SECOND

    require_one(**values_of(sensor, "imu", "accel", "vector", "port"))
    attached = Mounting() if mounting is None else load_mounting(mounting)
    mailbox = Mailbox(convention=reading.convention())
    with ExitStack() as stack:
        transport = stack.enter_context(network.joined("gravity"))
        attached = reading.mounted(attached, partial(heard_pose, transport))
        feed: Callable[[float], None] | None = None
        counts: Any
        if sensor.port is not None:
            device = stack.enter_context(
                SerialAccelerometer(sensor.port, mailbox, clock=lambda: transport.steady() / SECOND)
            )
            hello = device.wait_ready()
            print_notes([f"{sensor.port}: {hello.sensor}, {hello.rate_hz:g} Hz"])
            attached, angular, counts = device.with_ranges(attached), hello.has_gyroscope, device.counts
        else:
            name, kind = sensor.topic()
            subscription = GravityTopic(transport, name, kind, mailbox, points_down=sensor.points_down)
            print_notes([f"{subscription.topic}: waiting for {kind}"])
            feed, angular, counts = subscription.feed, sensor.imu is not None, subscription.tally
        angular = angular and not sensor.no_gyroscope
        arm = None
        if published.delta_of is not None:
            arm = LevelBaseArm(catenary.load_robot(published.delta_of), published.joints)
        if arm is not None and (mounting or reading.imu_frame):
            attached = attached.in_base_of(arm.model)  # whose axes its torques are of
        source = sensing.source(mailbox, attached, angular=angular, feed=feed)
        node = GravityNode(
            transport, source, topic=published.topic, frame_id=published.frame, urscript=published.urscript,
            arm=arm, link=lambda: asdict(counts),
        )  # fmt: skip
        _run(node, _gravity_line, published.rate, duration)
    if "live" not in node.tally.report().ticks:
        raise typer.Exit(FAULT_FOUND)


@group
class ToolTopics:
    """Options of what the tool's node hears and publishes."""

    wrench: str = option("TOPIC", "The sensor's geometry_msgs/WrenchStamped.", "/wrench")
    joints: str = option("TOPIC", "The arm's sensor_msgs/JointState.", "/joint_states")
    gravity: str | None = option("TOPIC", "Gravity of `catenary gravity-node`. [default: of a level base]")
    topic: str = option("TOPIC", "Topic that wrenches are published on.", "/tool/wrench")
    frame: str | None = option("FRAME", "Frame of the robot to publish wrenches in. [default: the sensor's own]")
    inertia: bool = option(None, "Also subtract the tool's inertial forces.", False)
    drift: float = option("N/MIN", "Rate of the sensor's zero that is followed while nothing touches.", 0.0, min=0.0)
    wait: float = option("S", "Publishing delay, for joint states around each reading.", 0.03, min=0.0)


@_prints_json_lines
def tool_node(
    topics: ToolTopics,
    network: NodeOptions,
    tool: Path = option("FILE", "The tool, as catenary payload --tool or --weigh writes it.", REQUIRED),
    robot: str | None = option("ROBOT", "The arm that carries it. [default: the file's]"),
    weigh: int | None = option("N", "First weigh the tool in N poses at rest, and write --tool.", min=6),
    sensor_frame: str | None = option("FRAME", "Frame of the sensor. [default: the tip]", goes_with="weigh"),
    accept: Sequence[str] = ACCEPT,
    duration: float | None = _DURATION,
) -> None:
    """Publish a force/torque sensor's wrench without the tool.

    Drive the arm through the poses to weigh the tool; publish "zero" or "weigh" on TOPIC/command. The exit code is 1
    when no wrench was published.

    Example: catenary tool-node --tool tool.toml --gravity /gravity --ros 1
    Example: catenary tool-node --tool tool.toml --weigh 12 --robot ur10e --ros 2
    """
    from catenary.nodes.tool_node import TOOL_RATE, ToolNode
    from catenary.sensing.wrist_tool import load_tool, save_tool

    known = None if weigh is not None else load_tool(tool)
    carrier = robot or ("" if known is None else known.robot)
    if not carrier:
        raise InputError("--robot: expected the arm that carries the tool")
    if known is None:
        refuse_outputs({"--tool": (tool, TOOL)})
    options = values_of(topics, "wrench", "joints", "gravity", "topic", "frame", "inertia", "wait")
    options |= {"drift": topics.drift / 60.0, "sensor_frame": sensor_frame, "poses": weigh or 12, "accept": accept}
    with network.joined("tool") as transport:
        print_notes([f"waiting for wrenches on {topics.wrench} and joints on {topics.joints}"])
        node = ToolNode(
            transport,
            catenary.load_robot(carrier),
            known,
            weighed=lambda measured: save_tool(tool, replace(measured, robot=carrier)),
            **options,
        )
        final = _run(node, _tool_line, TOOL_RATE, duration)
    if not final.published:
        raise typer.Exit(FAULT_FOUND)


def _shown(line: Callable[[Any], tuple[str, Sequence[str]]]) -> Callable[..., None]:
    """Return the function that prints a status: as JSON, or as a line to read and those remarks that are new."""
    printed: list[str] = []

    def show(status: "EncoderStatus | GravityStatus | ToolStatus", *, final: bool = False) -> None:
        if prints_json():
            print_json_line({"final": status.as_data()} if final else status.as_data())
            return
        text, remarks = line(status)
        master = "" if status.is_up else "  NO MASTER"
        print(f"{text}  {status.subscribers} programs listen{master}", flush=True)
        if list(remarks) != printed:
            printed[:] = remarks
            print_notes(printed)

    return show


def _run(
    node: "SteppedNode", line: Callable[[Any], tuple[str, Sequence[str]]], rate: float, duration: float | None
) -> Any:
    """Run a node at a rate [Hz] and print its status; return the last one."""
    from catenary.nodes.sensor_nodes import publish

    show = _shown(line)
    last = publish(node, rate_hz=rate, duration=duration, show=if_read(show))
    show(last, final=True)
    return last


def _encoder_line(status: "EncoderStatus") -> tuple[str, Sequence[str]]:
    reading = status.reading
    counts = " ".join(f"{value:.0f}" for value in reading.counts)
    place = reading.reason
    if reading.is_valid:
        place = " ".join(in_words(q, unit, 3) for q, unit in zip(reading.q_encoder, ("rad", "rad", "m"), strict=True))
    robot = f"  robot {status.robot}" if status.robot else ""
    text = f"{status.seconds:7.0f} s  {reading.rate_hz:4.0f} Hz  {counts} counts  {place}{robot}"
    return text, [reading.complaint] if reading.complaint else []


def _gravity_line(status: "GravityStatus") -> tuple[str, Sequence[str]]:
    x, y, z = status.reading.gravity
    tilt, state = status.as_data()["tilt_deg"], status.reading.status.value
    vector = f"gravity {x:+7.3f} {y:+7.3f} {z:+7.3f} m/s2 in axes of {status.base}"
    text = f"{status.seconds:7.0f} s  {vector}, tilt {tilt:.2f} deg, {state}"
    return text, status.warnings


def _tool_line(status: "ToolStatus") -> tuple[str, Sequence[str]]:
    x, y, z, *torque = status.wrench
    wrench = f"force {x:+7.2f} {y:+7.2f} {z:+7.2f} N, torque {torque[0]:+6.3f} {torque[1]:+6.3f} {torque[2]:+6.3f} Nm"
    off = (
        f"off by {max(status.deviation[:3]):.2g} N, {1000.0 * status.age_s:.0f} ms old"
        if status.published
        else "none yet"
    )
    return f"{status.seconds:7.0f} s  {status.status}  {wrench}, {off}", status.warnings
