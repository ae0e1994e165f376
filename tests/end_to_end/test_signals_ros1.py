"""Moving commands that are ended from outside, against the served robot over ROS 1: it holds, and is paused."""

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from catenary.crtk.client import CrtkClient
from catenary.crtk.ros1.transport import Ros1Transport
from patience import until
from ros import NODE, PATIENT_COMMAND, Master, Program

pytestmark = pytest.mark.slow

TERM, HUP, KILL = signal.SIGTERM, signal.SIGHUP, signal.SIGKILL
# Ctrl-C: test_tools_ros1
ENDS = [("goto", TERM), ("random", HUP), ("follow", KILL), ("excite", TERM)]


@pytest.fixture(scope="module")
def served(ros_master: Master, patient_node: None) -> Iterator[CrtkClient]:
    """A homed robot, and a program that looks at it."""
    with Program(ros_master, PATIENT_COMMAND, "serve", "--rate", "200", "--homed") as server:
        server.line()  # it is up
        with Ros1Transport(NODE) as transport, CrtkClient(transport) as one:
            yield one


def arguments(command: str, folder: Path, shoulder: float) -> list[str]:
    """What lets a command move for so long that it is ended long before."""
    robot = ["--ros", "1", "--simulated"]
    away = np.rad2deg(shoulder) + (20.0 if shoulder < 0.6 else -20.0)
    if command == "goto":
        return ["goto", "--q-deg", f"{away:.3f}", "--speed", "0.2", "--json", *robot]
    if command == "random":
        return ["random", "--seconds", "600", "--json", *robot]
    if command == "follow":
        file = folder / "run.csv"
        file.write_text(f"time [s],shoulder [deg]\n0,{np.rad2deg(shoulder)}\n600,{away}\n")
        return ["follow", str(file), "--json", *robot]
    return ["excite", str(folder / "project"), "--yes", *robot]


@pytest.mark.parametrize(("command", "number"), ENDS)
def test_a_command_that_is_ended_leaves_the_robot_holding_and_paused(
    ros_master: Master, served: CrtkClient, tmp_path: Path, command: str, number: signal.Signals
) -> None:
    if served.operating_state().state != "ENABLED":
        served.state_command("resume")
    begin = served.setpoint_js().q
    with Program(ros_master, PATIENT_COMMAND, *arguments(command, tmp_path, begin[0])) as program:
        until(lambda: np.abs(served.setpoint_js().q - begin).max() > 1e-3, every=0.005)
        program.process.send_signal(number)
        out, errors = program.finish()
    until(lambda: served.operating_state().state == "PAUSED", every=0.02)
    held = served.setpoint_js().q
    served.transport.sleep(0.1)
    np.testing.assert_array_equal(served.setpoint_js().q, held)
    assert "Traceback" not in errors
    if number == KILL:  # the server paused it
        assert program.process.returncode == -number
        return
    assert program.process.returncode == 128 + number, errors
    if command == "excite":
        assert f"ended by {number.name}" in errors
        return
    summary = json.loads(out)
    assert summary["ended_by"] == number.name
    assert summary["state"]["state"] == "PAUSED"
