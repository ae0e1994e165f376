"""A ROS 1 master of the tests' own, and programs that talk over it; skips, saying so, where ROS 1 is not installed."""

import os
import random
import signal
import socket
import subprocess
import sys
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Protocol

import pytest

from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.errors import MissingPackageError
from patience import PATIENCE, until

ROOT = Path(__file__).parents[1]
MASTER = (
    "import sys; from catenary.crtk.ros1.transport import make_rospy_importable; make_rospy_importable();"
    "import rosmaster; rosmaster.rosmaster_main(['rosmaster', '--core', '-p', sys.argv[1]])"
)

# programs wait for the master's answers longer than a robot's should
PATIENT = f"from catenary.crtk.ros1 import master as ros1_master; ros1_master._ANSWER_WITHIN_S = {PATIENCE}\n"
# what programs of the tests begin with: a node of their first argument's name
OPEN = """
import sys, time
from patience import PATIENCE
from catenary.crtk.ros1.transport import Ros1Transport
from catenary.crtk.message import message_class, header
from catenary.errors import TransportError
T = "crtk_msgs/StringStamped"
transport = Ros1Transport(sys.argv[1])
"""
# the catenary command as a program, and one that waits longer for others, where the machine is busy
COMMAND = "import sys; from catenary.cli.main import main; sys.argv[0] = 'catenary'; main()"
PATIENT_COMMAND = f"import patience; patience.lengthen_limits()\n{COMMAND}"
NODE = "catenary_test"  # of the process of the tests, which can be one node only


def require_ros1() -> None:
    """Skip where rospy or the master are missing."""
    try:
        make_rospy_importable()
    except MissingPackageError as error:
        pytest.skip(f"ROS 1 is not installed: {error}")
    pytest.importorskip("rosmaster", reason="ROS 1's master is not installed: apt install python3-rosmaster")


def free_port() -> int:
    """A port that nobody listens on, and that the system gives to nobody who asks for any."""
    first, last = map(int, Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split())
    ports = [port for port in range(5000, 65536) if not first <= port <= last]
    while True:
        port = random.SystemRandom().choice(ports)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port


class Master:
    """A master process, which can die and come back."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        self.environment = {
            **os.environ,
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(folder),
            "ROS_HOME": str(folder),
            "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")]),
        }
        self._output = folder / "master.txt"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and wait until it answers."""
        with self._output.open("ab") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-c", MASTER, str(self.port)],
                env=self.environment,
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        until(self._answers, every=0.05)

    def _answers(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, f"the master did not start: {self._output.read_text()}"
        try:
            with xmlrpc.client.ServerProxy(self.uri) as server:
                server.getPid("/tests")
        except OSError:
            return False
        return True

    def kill(self) -> None:
        """End it as a crash would."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


@contextmanager
def running_master(folder: Path) -> Iterator[Master]:
    """A master on a free port, killed afterwards."""
    require_ros1()
    master = Master(folder)
    master.start()
    try:
        yield master
    finally:
        master.kill()


def _heed_interrupts() -> None:
    """Undo what a shell does to programs in the background, which then pass it on: ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Network(Protocol):
    """Where programs meet: a master of ROS 1, or a domain of DDS."""

    environment: dict[str, str]


class Program:
    """A Python program beside the tests; lines go in and come out.

    Its errors go to a file: a pipe that nobody reads would be full after some hundred lines, and the program would wait.
    """

    def __init__(self, master: Network, code: str, *arguments: str, **environment: str) -> None:
        self._errors = TemporaryFile("a+")  # noqa: SIM115  # it ends with the program
        self.process = subprocess.Popen(
            [sys.executable, "-u", "-c", PATIENT + code, *arguments],
            env={**master.environment, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            preexec_fn=_heed_interrupts,
        )

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *exception: object) -> None:
        self.process.kill()
        self.process.communicate()

    def line(self) -> str:
        """Next line that it prints."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            self.process.wait()
            raise AssertionError(f"the program ended: {self.errors()}")
        return line.strip()

    def say(self, line: str) -> None:
        """Give it a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    @contextmanager
    def standing_still(self) -> Iterator[None]:
        """Have it do nothing at all meanwhile."""
        self.process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)

    def finish(self, seconds: float = 300.0) -> tuple[str, str]:
        """Wait for its end; give what it has printed since, and its errors."""
        return self.process.communicate(timeout=seconds)[0], self.errors()

    def errors(self) -> str:
        """Return all that it has written as errors."""
        self._errors.seek(0)
        return self._errors.read()
