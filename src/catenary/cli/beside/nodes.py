"""catenary encoders, gravity-node: devices as topics."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from catenary.cli.gravity_source import SensingOptions
from catenary.cli.options import Baud, Carrier, Duration, JsonLines, MountingFile, NodeName
from catenary.cli.terminal import numbers, print_json_line, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.nodes.encoder_node import EncoderStatus
    from catenary.nodes.gravity_node import GravityStatus


def encoders(
    port: Annotated[str, Option(metavar="PORT", help="Serial port, as /dev/ttyUSB0.")],
    ros: Carrier = "1",
    name: NodeName = None,
    bits: Annotated[int, Option(metavar="16|24|32", help="Width of the board's counters.")] = 32,
    direction: Annotated[
        str, Option(metavar="D,D,D", help="-1 for an encoder that counts against its joint.")
    ] = "1,1,1",
    state: Annotated[
        str, Option(metavar="TOPIC", help="Topic of the homing robot's operating state.")
    ] = "/arm1/operating_state",
    baud: Baud = 115200,
    duration: Duration = None,
    as_json: JsonLines = False,
) -> None:
    """Publish the counts and positions of joint encoders.

    Topics: joint_enc (counts) and, once registered, ext_jpos (rad, rad, m). Home the robot while this runs: its
    stops register the encoders.

    The exit code is 1 when positions were not valid at the end.

    Example: catenary encoders --port /dev/ttyUSB0 --ros 1
    """
    import numpy as np

    from catenary.crtk.network import make_transport, node_name
    from catenary.devices.encoder_board import EncoderBoard
    from catenary.devices.encoder_rig import EncoderRig
    from catenary.nodes.encoder_node import EncoderNode, publish_encoders

    rig = EncoderRig(bits=bits, direction=np.array(numbers("--direction", direction)))
    with (
        make_transport(ros, node_name("encoders", name)) as transport,
        EncoderBoard(port, rig, baud=baud) as board,
    ):
        board.wait_ready()
        node = EncoderNode(board, transport, state_topic=state)
        print_notes([f"{port}: counts come; home the robot, and its stops register the encoders"])
        show = _shown(_encoder_line, as_json)
        final = publish_encoders(node, duration=duration, show=show)
    show(final, final=True)
    if not final.reading.is_valid:
        raise typer.Exit(1)


def gravity_node(
    sensing: SensingOptions,
    imu: Annotated[str | None, Option(metavar="TOPIC", help="A sensor_msgs/Imu, as /imu/data_raw.")] = None,
    accel: Annotated[str | None, Option(metavar="TOPIC", help="A geometry_msgs/AccelStamped.")] = None,
    vector: Annotated[str | None, Option(metavar="TOPIC", help="A geometry_msgs/Vector3Stamped.")] = None,
    port: Annotated[str | None, Option(metavar="PORT", help="Serial port of an accelerometer board.")] = None,
    mounting: MountingFile = None,
    ros: Carrier = "1",
    name: NodeName = None,
    rate: Annotated[float, Option(metavar="HZ", help="Rate at which gravity is published.")] = 100.0,
    topic: Annotated[str, Option(metavar="TOPIC", help="Topic that gravity is published on.")] = "/gravity",
    frame: Annotated[str, Option(metavar="NAME", help="frame_id of the published gravity.")] = "base",
    points_down: Annotated[
        bool, Option("--points-down", help="The topic's vectors are gravity, not specific force.")
    ] = False,
    no_gyroscope: Annotated[bool, Option("--no-gyroscope", help="Ignore the Imu's angular rates.")] = False,
    baud: Baud = 115200,
    duration: Duration = None,
    as_json: JsonLines = False,
) -> None:
    """Publish gravity as a sensor on the base measures it.

    The exit code is 1 when nothing that can be believed was measured.

    Example: catenary gravity-node --ros 1 --imu /imu/data_raw --mounting mounting.toml
    """
    from catenary.crtk.gravity_topic import TYPES, GravityTopic, now_of
    from catenary.crtk.network import make_transport, node_name
    from catenary.devices.accelerometer import SerialAccelerometer
    from catenary.nodes.gravity_node import GravityNode, publish_gravity
    from catenary.sensing.mounting import Mounting, load_mounting
    from catenary.sensing.vector import Mailbox

    if sum(source is not None for source in (imu, accel, vector, port)) != 1:
        raise InputError("gravity-node: give one of --imu, --accel, --vector and --port")
    if port is not None and points_down:
        raise InputError("gravity-node: --points-down goes with a topic; a board sends specific force")
    told, mailbox = Mounting() if mounting is None else load_mounting(mounting), Mailbox()
    with ExitStack() as stack:
        transport = stack.enter_context(make_transport(ros, node_name("gravity", name)))
        feed: Callable[[float], None] | None = None
        counts: Any
        if port is not None:
            device = stack.enter_context(
                SerialAccelerometer(port, mailbox, baud=baud, clock=lambda: now_of(transport))
            )
            hello = device.wait_ready()
            print_notes([f"{port}: {hello.sensor}, {hello.rate_hz:g} Hz"])
            told, angular, counts = device.with_ranges(told), hello.has_gyroscope, device.counts
        else:
            given = zip((imu, accel, vector), TYPES, strict=True)
            name, kind = next((name, kind) for name, kind in given if name is not None)
            heard = GravityTopic(transport, name, kind, mailbox, points_down=points_down)
            print_notes([f"{heard.topic}: waiting for {kind}"])
            feed, angular, counts = heard.feed, imu is not None, heard.tally
        angular = angular and not no_gyroscope
        source = sensing.source(mailbox, told, angular=angular, feed=feed)
        node = GravityNode(transport, source, topic=topic, frame_id=frame)
        show = _shown(_gravity_line, as_json)
        final = publish_gravity(node, rate_hz=rate, duration=duration, link=lambda: asdict(counts), show=show)
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
    import numpy as np

    reading = status.reading
    counts = " ".join(f"{value:.0f}" for value in reading.counts)
    place = reading.reason
    if reading.is_valid:
        a, b, c = reading.q_encoder * [180.0 / np.pi, 180.0 / np.pi, 1e3]
        place = f"{a:.3f} deg {b:.3f} deg {c:.3f} mm"
    robot = f"  robot {status.robot}" if status.robot else ""
    text = f"{status.seconds:7.0f} s  {reading.rate_hz:4.0f} Hz  {counts} counts  {place}{robot}"
    return text, [reading.complaint] if reading.complaint else []


def _gravity_line(status: "GravityStatus") -> tuple[str, Sequence[str]]:
    x, y, z = status.reading.gravity
    tilt, state = status.as_data()["tilt_deg"], status.reading.status.value
    text = (
        f"{status.seconds:7.0f} s  gravity {x:+7.3f} {y:+7.3f} {z:+7.3f} m/s2, tilt {tilt:.2f} deg, {state}"
    )
    return text, status.warnings
