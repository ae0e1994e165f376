"""catenary encoders, gravity-node: devices as topics."""

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from catenary.cli.options import Baud, Carrier, Duration, Hanging, JsonLines, MountingFile
from catenary.cli.terminal import numbers, print_json_line, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.transport import Transport
    from catenary.nodes.encoders import EncoderStatus
    from catenary.nodes.gravity import GravityStatus
    from catenary.sensing.mailbox import Mailbox
    from catenary.sensing.mounting import Mounting


def encoders(
    port: Annotated[str, Option(metavar="PORT", help="Serial port, as /dev/ttyUSB0.")],
    ros: Carrier = "1",
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

    from catenary.crtk.network import make_transport
    from catenary.devices.encoder_board import EncoderBoard
    from catenary.devices.encoder_rig import EncoderRig
    from catenary.nodes.encoders import EncoderNode, publish_encoders

    rig = EncoderRig(bits=bits, direction=np.array(numbers("--direction", direction)))
    with make_transport(ros, "catenary_encoders") as transport, EncoderBoard(port, rig, baud=baud) as board:
        board.wait_ready()
        node = EncoderNode(board, transport, state_topic=state)
        print_notes([f"{port}: counts come; home the robot, and its stops register the encoders"])
        said: list[str] = []
        show: Callable[[EncoderStatus], None] = _json_line if as_json else lambda s: _encoder_line(s, said)
        final = publish_encoders(node, duration=duration, show=show)
    if as_json:
        _json_line(final, final=True)
    else:
        _encoder_line(final, said)
    if not final.reading.is_valid:
        raise typer.Exit(1)


def gravity_node(
    imu: Annotated[str | None, Option(metavar="TOPIC", help="A sensor_msgs/Imu, as /imu/data_raw.")] = None,
    accel: Annotated[str | None, Option(metavar="TOPIC", help="A geometry_msgs/AccelStamped.")] = None,
    vector: Annotated[str | None, Option(metavar="TOPIC", help="A geometry_msgs/Vector3Stamped.")] = None,
    port: Annotated[str | None, Option(metavar="PORT", help="Serial port of an accelerometer board.")] = None,
    mounting: MountingFile = None,
    ros: Carrier = "1",
    rate: Annotated[float, Option(metavar="HZ", help="Rate at which gravity is published.")] = 100.0,
    topic: Annotated[str, Option(metavar="TOPIC", help="Topic that gravity is published on.")] = "/gravity",
    frame: Annotated[str, Option(metavar="NAME", help="frame_id of the published gravity.")] = "base",
    fallback: Annotated[
        str, Option(metavar="hold|fade|static|stop", help="What is published when samples stop.")
    ] = "fade",
    points_down: Annotated[
        bool, Option("--points-down", help="The topic's vectors are gravity, not specific force.")
    ] = False,
    no_gyroscope: Annotated[bool, Option("--no-gyroscope", help="Ignore the Imu's angular rates.")] = False,
    hanging: Hanging = False,
    baud: Baud = 115200,
    duration: Duration = None,
    as_json: JsonLines = False,
) -> None:
    """Publish gravity as a sensor on the base measures it.

    The exit code is 1 when nothing that can be believed was measured.

    Example: catenary gravity-node --ros 1 --imu /imu/data_raw --mounting mounting.toml
    """
    from catenary.crtk.network import make_transport
    from catenary.nodes.gravity import GravityNode, publish_gravity
    from catenary.sensing.checks import SensorRules
    from catenary.sensing.imu import SensedGravity
    from catenary.sensing.mailbox import Mailbox
    from catenary.sensing.mounting import Mounting, load_mounting

    if sum(source is not None for source in (imu, accel, vector, port)) != 1:
        raise InputError("gravity-node: give one of --imu, --accel, --vector and --port")
    if port is not None and points_down:
        raise InputError("gravity-node: --points-down goes with a topic; a board sends specific force")
    told, mailbox = Mounting() if mounting is None else load_mounting(mounting), Mailbox()
    with ExitStack() as open_things:
        transport = open_things.enter_context(make_transport(ros, "catenary_gravity"))
        feed, link, told, angular = (
            _from_port(open_things, port, baud, transport, mailbox, told)
            if port is not None
            else _from_topic(imu, accel, vector, transport, mailbox, told, points_down)
        )
        source = SensedGravity(
            mailbox,
            told,
            angular=angular and not no_gyroscope,
            fallback=fallback,
            rules=SensorRules(max_tilt=math.pi) if hanging else None,
            feed=feed,
        )
        node = GravityNode(transport, source, topic=topic, frame_id=frame)
        said: list[str] = []
        show: Callable[[GravityStatus], None] = _json_line if as_json else lambda s: _gravity_line(s, said)
        final = publish_gravity(node, rate_hz=rate, duration=duration, link=link, show=show)
    if as_json:
        _json_line(final, final=True)
    else:
        _gravity_line(final, said)
    if "live" not in node.tally.report().ticks:
        raise typer.Exit(1)


_Source = tuple[Callable[[float], None] | None, Callable[[], dict[str, Any]], "Mounting", bool]


def _from_port(
    open_things: ExitStack, port: str, baud: int, transport: "Transport", mailbox: "Mailbox", told: "Mounting"
) -> _Source:
    from dataclasses import asdict

    from catenary.crtk.gravity_topic import now_of
    from catenary.devices.accelerometer import SerialAccelerometer

    device = open_things.enter_context(
        SerialAccelerometer(port, mailbox, baud=baud, clock=lambda: now_of(transport))
    )
    hello = device.wait_ready()
    print_notes([f"{port}: {hello.sensor}, {hello.rate_hz:g} Hz"])
    return None, lambda: asdict(device.counts), device.with_ranges(told), hello.has_gyroscope


def _from_topic(
    imu: str | None,
    accel: str | None,
    vector: str | None,
    transport: "Transport",
    mailbox: "Mailbox",
    told: "Mounting",
    points_down: bool,
) -> _Source:
    from dataclasses import asdict

    from catenary.crtk.gravity_topic import TYPES, GravityTopic

    name, kind = next(
        (name, kind) for name, kind in zip((imu, accel, vector), TYPES, strict=True) if name is not None
    )
    topic = GravityTopic(transport, name, kind, mailbox, points_down=points_down)
    print_notes([f"{topic.topic}: waiting for {kind}"])
    return topic.feed, lambda: asdict(topic.tally), told, imu is not None


def _json_line(status: "EncoderStatus | GravityStatus", *, final: bool = False) -> None:
    print_json_line({"final": status.as_data()} if final else status.as_data())


def _encoder_line(status: "EncoderStatus", said: list[str]) -> None:
    import numpy as np

    reading = status.reading
    counts = " ".join(f"{value:.0f}" for value in reading.counts)
    place = reading.reason
    if reading.is_valid:
        a, b, c = reading.q_encoder * [180.0 / np.pi, 180.0 / np.pi, 1e3]
        place = f"{a:.3f} deg {b:.3f} deg {c:.3f} mm"
    robot = f"  robot {status.robot}" if status.robot else ""
    print(
        f"{status.seconds:7.0f} s  {reading.rate_hz:4.0f} Hz  {counts} counts  {place}{robot}  "
        f"{status.subscribers} programs listen{'' if status.is_up else '  NO MASTER'}",
        flush=True,
    )
    if reading.complaint and said[-1:] != [reading.complaint]:
        said[:] = [reading.complaint]
        print_notes([reading.complaint])


def _gravity_line(status: "GravityStatus", said: list[str]) -> None:
    x, y, z = status.reading.gravity
    data = status.as_data()
    print(
        f"{status.seconds:7.0f} s  gravity {x:+7.3f} {y:+7.3f} {z:+7.3f} m/s2, tilt {data['tilt_deg']:.2f} deg, "
        f"{status.reading.status.value}  {status.subscribers} programs listen"
        f"{'' if status.is_up else '  NO MASTER'}",
        flush=True,
    )
    if list(status.warnings) != said:
        said[:] = status.warnings
        print_notes(said)
