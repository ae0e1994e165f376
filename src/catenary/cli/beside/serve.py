"""catenary serve, button."""

import contextlib
import logging
import sys
from collections import deque
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from catenary.cli.options import (
    AsJson,
    Carrier,
    Duration,
    JsonLines,
    NodeName,
    SimulatedSeed,
    robots_beginning,
)
from catenary.cli.terminal import announce, base_tilt, print_json, print_json_line, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.crtk.serving.server import Server
    from catenary.nodes.serve import ServerStatus


def serve(
    robot: Annotated[
        str, Option(metavar="NAME", help="Robot to simulate.", autocompletion=robots_beginning)
    ] = "raven2",
    dialect: Annotated[
        str | None,
        Option(
            metavar="raven|crtk",
            help="Topics of the RAVEN-II, or the present CRTK. [default: the robot's own]",
        ),
    ] = None,
    namespace: Annotated[
        str | None, Option(metavar="/NAME", help="Of a dVRK PSM: in front of its topics. [default: /PSM1]")
    ] = None,
    ros: Carrier = "1",
    name: Annotated[
        str, Option("--name", metavar="NAME", help="Of the robot's node; two cannot have one.")
    ] = "catenary_robot",
    rate: Annotated[float, Option(metavar="HZ", help="Rate at which its state is published.")] = 1000.0,
    seed: SimulatedSeed = None,
    base_tilt_deg: Annotated[
        str, Option(metavar="ROLL,PITCH", help="Tilt of the base: roll about x, then pitch about y.")
    ] = "0,0",
    payload: Annotated[float, Option(metavar="KG", help="Mass at the tool's wrist.")] = 0.0,
    green: Annotated[bool, Option("--green", help="Let the green arm move too; else it is parked.")] = False,
    homed: Annotated[bool, Option("--homed", help="Begin homed; homing takes half a minute.")] = False,
    encoders: Annotated[
        bool,
        Option(
            "--encoders/--no-encoders",
            help="Dialect raven: publish external encoders at the gold arm's joints, /ext_jpos and /joint_enc; of a "
            "PSM what a tracker sees, tracker/measured_js.",
        ),
    ] = True,
    start: Annotated[
        bool, Option("--start", help="Press the silver button at once; with crtk: enable and home.")
    ] = False,
    grav_dir: Annotated[
        str | None,
        Option(
            metavar="X,Y,Z",
            help="Gravity compensation of the robot's own, by this gravity in whole cm/s2, z down: 0,0,980 as on the "
            "real one. [default: none]",
        ),
    ] = None,
    torque_arm: Annotated[
        str | None,
        Option(
            metavar="gold|green",
            help="Dialect raven: this arm's servo_jp carries torques of its motors in mNm, as on the robot that the UW "
            "changed for its torque controller. [default: none]",
        ),
    ] = None,
    duration: Duration = None,
    as_json: JsonLines = False,
) -> None:
    """Serve a simulated robot over ROS, in real time.

    Type `button` and Enter, or run `catenary button`, to press the silver button; or type a state
    command, or `grav-dir 0,0,980` and `grav-dir off` for the robot's own gravity compensation.

    Examples: catenary serve --ros none --homed --duration 2; catenary serve --robot dvrk_psm --namespace /PSM1
    """
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.serving.server import whole_numbers
    from catenary.nodes.serve import Serving, make_server, prepare
    from catenary.nodes.serve import serve as run
    from catenary.open_robot import Simulated, tilted_base

    is_raven = robot == "raven2"
    dialect = dialect or ("raven" if is_raven else "crtk")
    if dialect not in ("raven", "crtk"):
        raise InputError(f'--dialect "{dialect}": expected raven or crtk')
    if torque_arm not in (None, "gold", "green"):
        raise InputError(f'--torque-arm "{torque_arm}": expected gold or green')
    tilt = base_tilt(base_tilt_deg)
    by = None if grav_dir is None else whole_numbers(grav_dir)
    # what it reports is in the status, which is shown; Python would print it a second time
    logging.getLogger("catenary.crtk.serving.reports").addHandler(logging.NullHandler())
    if is_raven and namespace is not None:
        raise InputError("--namespace: a RAVEN-II has none; its arms are /arm1 and /arm2")
    where = Simulated(seed, tilted_base(tilt), payload, homed=homed, grav_dir=by)
    serving = Serving(
        robot, dialect, where, green, encoders,  # type: ignore[arg-type]
        torque_arm=torque_arm, namespace=namespace or "/PSM1",
    )  # fmt: skip
    with make_transport(ros, node_name("robot", name)) as transport:
        server = make_server(serving, transport, rate_hz=rate)
        commands = deque(["start"] if start else [])
        announce("preparing the robot ...")
        prepare(server)
        print_notes([_greeting(server, dialect, ros)])
        _listen(commands)
        final = run(server, commands=commands, show=_show_json if as_json else _show, duration=duration)
    arms = ", ".join(f"{name} {text}" for name, text in final.states.items())
    print_notes([f"ended by {final.ended_by or 'its duration'}: {arms}"])
    if as_json:
        _show_json(final, final=True)
    else:
        print(
            f"{final.seconds:.1f} s at {final.rate_hz:.0f} Hz, {100 * final.cpu:.0f} % of a core; ticks lost: "
            f"{final.lost_ticks}; messages that clients missed: {final.overflowed}"
        )


def button(ros: Carrier = "1", name: NodeName = None, as_json: AsJson = False) -> None:
    """Press the silver button of a served RAVEN-II: it homes."""
    from catenary.crtk.network import make_transport, node_name
    from catenary.crtk.topic_names import BUTTON, BUTTON_TYPE

    with make_transport(ros, node_name("button", name)) as transport:
        answer = transport.call(BUTTON, BUTTON_TYPE)
    if as_json:
        print_json({"success": answer.success, "message": answer.message})
    else:
        print(answer.message)
    if not answer.success:
        raise typer.Exit(1)


def _greeting(server: "Server", dialect: str, ros: str) -> str:
    where = {"1": "over ROS 1", "2": "over ROS 2", "none": "to nobody: without ROS no other program hears it"}
    text = f"serving {server.published} topics in dialect {dialect} {where[ros]}; Ctrl-C ends it"
    if server.button is not None:
        text += "; `button` and Enter, or `catenary button`, presses the silver button"
    return text


def _listen(commands: deque[str]) -> None:
    """Take lines from standard input, in a thread that ends with the program."""
    import threading

    if sys.stdin is None or sys.stdin.closed:
        return

    def read() -> None:
        # a standard input that nobody can read, or that is closed
        with contextlib.suppress(OSError, ValueError):
            for line in sys.stdin:
                if line.strip():
                    commands.append(line.strip())

    threading.Thread(target=read, name="keyboard", daemon=True).start()


def _show(status: "ServerStatus") -> None:
    arms = ", ".join(f"{name} {text}" for name, text in status.states.items())
    line = (
        f"{status.seconds:7.0f} s  {status.rate_hz:5.0f} Hz  {100 * status.cpu:3.0f} % cpu  {arms}  "
        f"{status.commands_hz:.0f} commands/s of {status.clients} programs"
    )
    if status.lost_ticks:
        line += f"  {status.lost_ticks} ticks lost"
    if not status.is_up:
        line += "  NO MASTER"
    print(line, flush=True)
    print_notes(status.warnings)


def _show_json(status: "ServerStatus", *, final: bool = False) -> None:
    print_json_line(status._asdict() | {"final": final})
