"""catenary serve, button, encoders, gravity-node: simulated robots and devices as topics."""

import logging
import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE, MOUNTING_FILE, ReadingOptions, SensingOptions
from catenary.cli.options import AS_JSON, LINES_AS_JSON, REQUIRED, Triple, option, require_one
from catenary.cli.robot_options import CARRIER, NODE_NAME, SIMULATED_SEED
from catenary.cli.terminal import announce, print_json_line, print_notes, print_result
from catenary.crtk.dialects import DIALECTS
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.nodes.encoder_node import EncoderStatus
    from catenary.nodes.gravity_node import GravityStatus
    from catenary.nodes.serve import ServerStatus

DURATION = option("S", "How long to run. [default: until Ctrl-C]", least=0.0)


def serve(
    robot: str = option("ROBOT", "Robot to simulate.", "raven2"),
    dialect: str | None = option("|".join(DIALECTS), "Dialect of the topics. [default: the robot's own]"),
    namespace: str | None = option("/NAME", "Namespace of a dVRK PSM's topics. [default: /PSM1]"),
    ros: str = CARRIER,
    name: str = option("NAME", "Name of the robot's ROS node; it must be unique.", "catenary_robot"),
    rate: float = option("HZ", "Rate at which its state is published.", 1000.0),
    depth: int = option("N", "Queue length per topic for clients that do not keep up.", 100, least=1),
    qos: str = option("reliable|best-effort", "On ROS 2: quality of service of frequent topics.", "reliable"),
    seed: int | None = SIMULATED_SEED,
    base_tilt_deg: tuple[float, float] = replace(BASE_TILT, default=LEVEL_BASE),
    payload: float = option("KG", "Mass at the tool's wrist.", 0.0),
    green: bool = option(None, "Let the green arm move too; else it is parked.", False),
    homed: bool = option(None, "Begin homed; homing takes half a minute.", False),
    encoders: bool = option(
        None, "Publish external encoders of a RAVEN-II, a tracker of a PSM.", True, flag="--encoders/--no-encoders"
    ),
    start: bool = option(None, "Press the silver button at once; with crtk: enable and home.", False),
    grav_dir: Triple | None = option("X,Y,Z", "Gravity for the robot's own compensation, in whole cm/s2, z down."),
    duration: float | None = DURATION,
    as_json: bool = LINES_AS_JSON,
) -> None:
    """Serve a simulated robot over ROS, in real time.

    `catenary button` presses the silver button of a RAVEN-II.

    Example: catenary serve --ros none --homed --duration 2
    Example: catenary serve --robot dvrk_psm --namespace /PSM1
    """
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.transport import Sending
    from catenary.nodes.serve import Serving, make_server, prepare
    from catenary.nodes.serve import serve as run
    from catenary.open_robot import Simulated, tilted_base

    is_raven = robot == "raven2"
    dialect = dialect or ("raven" if is_raven else "crtk")
    # what it reports is in the status, which is shown; Python would print it a second time
    logging.getLogger("catenary.crtk.serving.reports").addHandler(logging.NullHandler())
    if is_raven and namespace is not None:
        raise InputError("--namespace: a RAVEN-II has none; its arms are /arm1 and /arm2")
    simulated = Simulated(seed, tilted_base(base_tilt_deg), payload, homed=homed, grav_dir=grav_dir)
    serving = Serving(robot, dialect, simulated, green, encoders, namespace=namespace or "/PSM1")
    if qos != "reliable" and ros != "2":
        raise InputError("--qos best-effort: goes with --ros 2; ROS 1 loses nothing on the way")
    with make_transport(ros, node_name("robot", name)) as transport:
        transport.sending = Sending(depth, qos == "reliable")
        announce("preparing the robot ...")  # an entry of one that crashed may have to lapse
        server = make_server(serving, transport, rate_hz=rate)
        prepare(server)
        where = {"1": "over ROS 1", "2": "over ROS 2", "none": "to nobody: without ROS no other program hears it"}[ros]
        pressed = "" if server.button is None else "; `catenary button` presses the silver button"
        print_notes([f"serving {server.published} topics in dialect {dialect} {where}; Ctrl-C ends it{pressed}"])
        final = run(server, start=start, show=_show_json if as_json else _show, duration=duration)
    arms = ", ".join(f"{name} {text}" for name, text in final.states.items())
    print_notes([f"ended by {final.ended_by or 'its duration'}: {arms}"])
    if as_json:
        _show_json(final, final=True)
        return
    print(
        f"{final.seconds:.1f} s at {final.rate_hz:.0f} Hz, {100 * final.cpu:.0f} % of a core; ticks lost: "
        f"{final.lost_ticks}; messages that clients missed: {final.overflowed}"
        + "".join(f", {count} of {client}" for client, count in sorted(final.missed.items()))
    )


def button(ros: str = CARRIER, name: str | None = NODE_NAME, as_json: bool = AS_JSON) -> None:
    """Press the silver button of a served RAVEN-II: it homes."""
    from catenary.crtk.client import press_button
    from catenary.crtk.network import make_transport, node_name

    with make_transport(ros, node_name("button", name)) as transport:
        success, message = press_button(transport)
    print_result(as_json, {"success": success, "message": message}, message)
    if not success:
        raise typer.Exit(1)


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


def encoders(
    port: str = option("PORT", "Serial port, as /dev/ttyUSB0.", REQUIRED),
    ros: str = CARRIER,
    name: str | None = NODE_NAME,
    bits: int = option("16|24|32", "Width of the board's counters.", 32),
    direction: Triple = option("D,D,D", "-1 for an encoder that counts against its joint.", (1.0, 1.0, 1.0)),
    state: str = option("TOPIC", "Topic of the homing robot's operating state.", "/arm1/operating_state"),
    duration: float | None = DURATION,
    as_json: bool = LINES_AS_JSON,
) -> None:
    """Publish the counts and positions of joint encoders.

    Topics: joint_enc (counts) and, once registered, ext_jpos (rad, rad, m). Home the robot while this runs: its
    stops register the encoders. The exit code is 1 when positions were not valid at the end.

    Example: catenary encoders --port /dev/ttyUSB0 --ros 1
    """
    import numpy as np

    from catenary.crtk.network import make_transport, node_name
    from catenary.devices.encoder_board import EncoderBoard
    from catenary.devices.encoder_rig import EncoderRig
    from catenary.nodes.encoder_node import RATE, EncoderNode
    from catenary.nodes.publishing import publish

    rig = EncoderRig(bits=bits, direction=np.array(direction))
    with make_transport(ros, node_name("encoders", name)) as transport, EncoderBoard(port, rig) as board:
        board.wait_ready()
        node = EncoderNode(board, transport, state_topic=state)
        print_notes([f"{port}: counts come; home the robot, and its stops register the encoders"])
        show = _shown(_encoder_line, as_json)
        final = publish(node, rate_hz=RATE, duration=duration, show=show)
    show(final, final=True)
    if not final.reading.is_valid:
        raise typer.Exit(1)


def gravity_node(
    sensing: SensingOptions,
    reading: ReadingOptions,
    imu: str | None = option("TOPIC", "A sensor_msgs/Imu, as /imu/data_raw."),
    accel: str | None = option("TOPIC", "A geometry_msgs/AccelStamped."),
    vector: str | None = option("TOPIC", "A geometry_msgs/Vector3Stamped."),
    port: str | None = option("PORT", "Serial port of an accelerometer board."),
    mounting: Path | None = MOUNTING_FILE,
    ros: str = CARRIER,
    name: str | None = NODE_NAME,
    rate: float = option("HZ", "Rate at which gravity is published.", 100.0),
    topic: str = option("TOPIC", "Topic that gravity is published on.", "/gravity"),
    frame: str | None = option("NAME", "frame_id of the published gravity. [default: the mounting's base]"),
    delta_of: str | None = option("ROBOT", "Also publish the torques that its level-base firmware lacks: TOPIC/delta."),
    joints: str = option("TOPIC", "Joints of --delta-of, a sensor_msgs/JointState.", "/joint_states"),
    points_down: bool = option(None, "The topic's vectors are gravity, not specific force.", False, not_with="port"),
    urscript: str | None = option("TOPIC", "Also set gravity on a Universal Robot, by its driver's script topic."),
    no_gyroscope: bool = option(None, "Ignore the IMU's angular rates.", False),
    duration: float | None = DURATION,
    as_json: bool = LINES_AS_JSON,
) -> None:
    """Publish gravity as a sensor on the base measures it.

    The exit code is 1 when no sample was valid.

    Example: catenary gravity-node --ros 1 --imu /imu/data_raw --mounting mounting.toml
    """
    from catenary.crtk.clock import SECOND
    from catenary.crtk.gravity_topic import GRAVITY_TYPES, GravityTopic
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.transforms import heard_pose
    from catenary.devices.accelerometer import SerialAccelerometer
    from catenary.nodes.gravity_node import GravityNode, LevelBaseArm
    from catenary.nodes.publishing import publish
    from catenary.sensing.mounting import Mounting, load_mounting
    from catenary.sensing.vector import Mailbox

    require_one(imu=imu, accel=accel, vector=vector, port=port)
    told = Mounting() if mounting is None else load_mounting(mounting)
    mailbox = Mailbox(convention=reading.convention())
    with ExitStack() as stack:
        transport = stack.enter_context(make_transport(ros, node_name("gravity", name)))
        told = reading.mounted(told, partial(heard_pose, transport))
        feed: Callable[[float], None] | None = None
        counts: Any
        if port is not None:
            device = stack.enter_context(SerialAccelerometer(port, mailbox, clock=lambda: transport.steady() / SECOND))
            hello = device.wait_ready()
            print_notes([f"{port}: {hello.sensor}, {hello.rate_hz:g} Hz"])
            told, angular, counts = device.with_ranges(told), hello.has_gyroscope, device.counts
        else:
            given = zip((imu, accel, vector), GRAVITY_TYPES, strict=True)
            name, kind = next((name, kind) for name, kind in given if name is not None)
            heard = GravityTopic(transport, name, kind, mailbox, points_down=points_down)
            print_notes([f"{heard.topic}: waiting for {kind}"])
            feed, angular, counts = heard.feed, imu is not None, heard.tally
        angular = angular and not no_gyroscope
        arm = None if delta_of is None else LevelBaseArm(catenary.load_robot(delta_of), joints)
        if arm is not None and (mounting or reading.imu_frame):
            told = told.in_base_of(arm.model)  # whose axes its torques are of
        source = sensing.source(mailbox, told, angular=angular, feed=feed)
        node = GravityNode(
            transport, source, topic=topic, frame_id=frame, urscript=urscript, arm=arm, link=lambda: asdict(counts)
        )
        show = _shown(_gravity_line, as_json)
        final = publish(node, rate_hz=rate, duration=duration, show=show)
    show(final, final=True)
    if "live" not in node.tally.report().ticks:
        raise typer.Exit(1)


def _shown(line: Callable[[Any], tuple[str, Sequence[str]]], as_json: bool) -> Callable[..., None]:
    """Return what prints a status: as JSON, or as a line to read and those remarks that are new."""
    said: list[str] = []

    def show(status: "EncoderStatus | GravityStatus", *, final: bool = False) -> None:
        if as_json:
            print_json_line({"final": status.as_data()} if final else status.as_data())
            return
        text, remarks = line(status)
        master = "" if status.is_up else "  NO MASTER"
        print(f"{text}  {status.subscribers} programs listen{master}", flush=True)
        if list(remarks) != said:
            said[:] = remarks
            print_notes(said)

    return show


def _encoder_line(status: "EncoderStatus") -> tuple[str, Sequence[str]]:
    reading = status.reading
    counts = " ".join(f"{value:.0f}" for value in reading.counts)
    place = reading.reason
    if reading.is_valid:
        a, b, c = reading.q_encoder * [180.0 / math.pi, 180.0 / math.pi, 1e3]
        place = f"{a:.3f} deg {b:.3f} deg {c:.3f} mm"
    robot = f"  robot {status.robot}" if status.robot else ""
    text = f"{status.seconds:7.0f} s  {reading.rate_hz:4.0f} Hz  {counts} counts  {place}{robot}"
    return text, [reading.complaint] if reading.complaint else []


def _gravity_line(status: "GravityStatus") -> tuple[str, Sequence[str]]:
    x, y, z = status.reading.gravity
    tilt, state = status.as_data()["tilt_deg"], status.reading.status.value
    vector = f"gravity {x:+7.3f} {y:+7.3f} {z:+7.3f} m/s2 in axes of {status.base}"
    text = f"{status.seconds:7.0f} s  {vector}, tilt {tilt:.2f} deg, {state}"
    return text, status.warnings
