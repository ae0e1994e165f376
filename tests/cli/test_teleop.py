import json
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time

import pytest

from command_line import refusal


class Typist:
    """The real command on a pseudo-terminal."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        command = [sys.executable, "-m", "catenary.cli.main", "teleop", "--json"]
        self.process = subprocess.Popen(command, stdin=self.slave, stdout=self.slave, stderr=subprocess.PIPE)
        self.seen = b""

    def wait_for(self, text: bytes, seconds: float = 120.0) -> None:
        end = time.monotonic() + seconds
        while text not in self.seen:
            assert time.monotonic() < end, self.seen[-2000:]
            if select.select([self.master], [], [], 0.1)[0]:
                self.seen += os.read(self.master, 65536)

    def end(self) -> dict[str, object]:
        self.wait_for(b'"state"')
        self.wait_for(b"\n}", 10.0)
        assert self.process.wait(30.0) == 0
        return json.loads(self.seen[self.seen.rindex(b"\x1b[?1049l") + 8 :])


@pytest.mark.slow
def test_the_real_command_moves_a_simulated_robot_and_leaves_the_terminal_as_it_was() -> None:
    typist = Typist()
    typist.wait_for(b"catenary teleop")
    for _ in range(25):
        os.write(typist.master, b"q")
        time.sleep(0.04)
    os.write(typist.master, b"Q")
    end = typist.end()
    assert end["state"]["state"] == "PAUSED"
    assert end["q"][0] > 0.53  # homed at 30 deg, 0.5236 rad
    assert termios.tcgetattr(typist.slave) == typist.before


@pytest.mark.slow
def test_a_signal_pauses_the_robot_and_restores_the_terminal() -> None:
    typist = Typist()
    typist.wait_for(b"catenary teleop")
    typist.process.send_signal(signal.SIGTERM)
    end = typist.end()
    assert end["ended_by"] == "SIGTERM"
    assert end["state"]["state"] == "PAUSED"
    assert termios.tcgetattr(typist.slave) == typist.before


def test_without_a_terminal_it_says_so() -> None:
    assert "ssh -t" in refusal("teleop")
