"""Programs that stand still (SIGSTOP) while one moves a served robot: the server, its client, or both, as on a computer
that is suspended; over ROS 1 and ROS 2, where they are installed.

Held is what docs/reliability.md says: the arm holds meanwhile, and whether the client ends by itself, is killed while
it is stopped, or goes on and is ended, the arm holds and is PAUSED.
"""

import atexit
import functools
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from tests.campaign.part import PROGRAMS, Fell, Part

COMMANDS = ("random", "goto", "calibrate")
KINDS = ("server", "server, client killed", "client", "client killed", "both", "both, client killed")
LATE = 3.0  # [s] for a busy machine, besides the documented 3
# [s] until one that was killed is missed over ROS 2, at most; also one that ends just after both were for so long out of
# touch that they have lost each other
LEASE = 12.0
WATCHDOG = 1.0  # [s] after which an arm holds: the documented 0.25, and as much as a busy machine may take
# programs wait for others as long as the machine needs, but stamps and silence are judged as they always are
PROGRAM = """
import patience
from catenary.crtk import client
for place, name, value in patience.longer_limits():
    if name in ("_ANSWER_WITHIN_S", "_COMMAND_TIMEOUT_S"):
        setattr(place, name, value)
client.CrtkClient.__init__.__kwdefaults__["connect_timeout"] = patience.PATIENCE
import sys; from catenary.cli.main import main; sys.argv[0] = 'catenary'; main()
"""


def ros1_is_installed() -> bool:
    places = ("/usr/lib/python3/dist-packages", "/opt/ros/noetic/lib/python3/dist-packages")
    return any((Path(place) / "rosmaster").is_dir() and (Path(place) / "rospy").is_dir() for place in places)


@functools.cache
def served(ros: str) -> tuple[Any, Any, Any]:
    """A network, a program that serves a homed robot, and a client that looks at it, until this process ends."""
    stack = ExitStack()
    atexit.register(stack.close)
    from catenary.crtk.client import CrtkClient
    from catenary.crtk.network import make_transport
    from dds import Network
    from patience import PATIENCE, lengthen_limits
    from ros import NODE, Program, running_master

    lengthen_limits()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    network: Any = stack.enter_context(running_master(folder)) if ros == "1" else Network()
    os.environ |= {name: text for name, text in network.environment.items() if "ROS" in name or "DDS" in name}
    options = ("serve", "--ros", ros, "--rate", "200", "--homed")
    server = stack.enter_context(Program(network, PROGRAM, *options))
    server.line()
    transport = stack.enter_context(make_transport(ros, NODE))
    watch = CrtkClient(transport, stale_after=PATIENCE, connect_timeout=PATIENCE)
    return network, server, stack.enter_context(watch)


def _moving(ros: str, command: str, folder: Path) -> Any:
    """Start a command and wait until it moves the robot; a busy machine may end it before."""
    from ended_commands import arguments, takes_signals
    from patience import until
    from ros import Program

    network, _, robot = served(ros)
    for attempt in range(3):
        if robot.operating_state().state != "ENABLED":
            robot.state_command("resume")
        place = folder / str(attempt)
        place.mkdir()
        words = arguments(command, place, robot.setpoint_js().q[0])
        words[words.index("--ros") + 1] = ros
        client = Program(network, PROGRAM, *words)

        def has_ended(client: Any = client) -> bool:
            return client.process.poll() is not None

        until(lambda has_ended=has_ended, client=client: has_ended() or takes_signals(client.process.pid))
        begin = robot.setpoint_js().q
        until(
            lambda has_ended=has_ended, begin=begin: has_ended() or np.abs(robot.setpoint_js().q - begin).max() > 5e-3,
            every=0.02,
        )
        if not has_ended():
            return client
        errors = client.finish()[1]
    raise Fell(f"{command} does not move: {errors[-1000:]}")


def stall(ros: str, seed: int, folder: Path) -> None:
    """Stop programs for a while, as the seed says; then the client is gone, one way or another."""
    rng = random.Random(seed)
    command, kind = COMMANDS[seed % 3], KINDS[seed // 3 % len(KINDS)]
    seconds = rng.uniform(10.5, 12.5) if rng.random() < 0.15 else rng.uniform(0.1, 4.0)
    _, server, robot = served(ros)
    client = _moving(ros, command, folder)
    where = f"{command}, {kind} for {seconds:.1f} s: "
    with client:
        begin, stopped = time.monotonic(), []
        for name, program in (("server", server), ("client", client)):
            if name in kind.partition(",")[0] or kind.startswith("both"):
                program.process.send_signal(signal.SIGSTOP)
                stopped.append(program)
        try:
            if kind.startswith("client"):
                _look(where, lambda: robot.setpoint_js().q, seconds)
            if kind == "server, client killed":  # before it ends by itself
                time.sleep(rng.uniform(0.0, 0.15))
                client.process.kill()
            time.sleep(max(0.0, begin + seconds - time.monotonic()))
            if "killed" in kind:
                client.process.kill()
                client.process.wait()
        finally:
            for program in stopped:
                program.process.send_signal(signal.SIGCONT)
        going_on = time.monotonic()
        if "killed" not in kind:
            _end(client, rng.uniform(0.0, 3.0))
        code, gone = client.process.returncode, time.monotonic()
        errors = client.finish()[1]
    if "Traceback" in errors:
        raise Fell(f"{where}{errors[-3000:]}")
    expected = (-9, 2) if "killed" in kind else (2, 130, -2)  # on a busy machine it may end before
    if code not in expected:
        raise Fell(f"{where}exit {code}: {errors[-1000:]}")
    missed = LEASE if ros == "2" and ("killed" in kind or seconds > 9.0) else 0.0
    _check_paused(where, robot, max(gone, going_on) + 3.0 + LATE + missed)


def _end(client: Any, seconds: float) -> None:
    """Let a client go on for a while; it may end by itself, or be ended."""
    end = time.monotonic() + seconds
    while client.process.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    if client.process.poll() is None:
        client.interrupt()
    client.process.wait(60.0)


def _look(where: str, setpoint: Callable[[], "np.ndarray"], seconds: float) -> None:
    """The arm holds while its client is stopped."""
    if seconds < 2.0 * WATCHDOG:
        return
    time.sleep(WATCHDOG)
    held = setpoint()
    time.sleep(0.5 * WATCHDOG)
    if not np.array_equal(setpoint(), held):
        raise Fell(f"{where}the arm goes on while its client is stopped")


def _check_paused(where: str, robot: Any, until: float) -> None:
    """It is PAUSED in time, and stays where it is."""
    while robot.operating_state().state != "PAUSED":
        if time.monotonic() > until:
            raise Fell(f"{where}the arm is {robot.operating_state()}")
        time.sleep(0.02)
    robot.transport.sleep(0.2)
    held = robot.setpoint_js().q
    robot.transport.sleep(0.2)
    if not np.array_equal(robot.setpoint_js().q, held):
        raise Fell(f"{where}a paused arm moves")


PARTS = (
    *([Part("stalls.ros1", 36, functools.partial(stall, "1"), **PROGRAMS)] if ros1_is_installed() else []),
    *([Part("stalls.ros2", 36, functools.partial(stall, "2"), **PROGRAMS)] if find_spec("cyclonedds") else []),
)
