"""Commands that move a served robot over ROS 1, and what must be so when a signal has ended one."""

import json
import os
import signal
from pathlib import Path

import numpy as np

from catenary.crtk.client import CrtkClient
from patience import until
from ros import PATIENT_COMMAND, Master, Program
from typist import Typist

OVER_ROS = ("goto", "random", "follow", "excite", "calibrate", "teleop")
ROBOT = ("--ros", "1", "--simulated")


def arguments(command: str, folder: Path, shoulder: float) -> list[str]:
    """What lets a command move for so long that it is ended long before."""
    away = np.rad2deg(shoulder) + (20.0 if shoulder < 0.6 else -20.0)
    if command == "goto":
        return ["goto", "--q-deg", f"{away:.3f}", "--speed", "0.2", "--json", *ROBOT]
    if command == "random":
        return ["random", "--seconds", "600", "--json", *ROBOT]
    if command == "follow":
        file = folder / "run.csv"
        file.write_text(f"time [s],shoulder [deg]\n0,{np.rad2deg(shoulder)}\n600,{away}\n")
        return ["follow", str(file), "--json", *ROBOT]
    return [command, str(folder / "project"), "--yes", *ROBOT]


def end_over_ros(master: Master, served: CrtkClient, folder: Path, command: str, number: signal.Signals) -> None:
    """End a command that moves a robot: it holds and is PAUSED, and the exit code is the documented one."""
    if served.operating_state().state != "ENABLED":
        served.state_command("resume")
    begin = served.setpoint_js().q
    code, out, errors = (_end_teleop if command == "teleop" else _end_program)(master, served, folder, command, number)
    assert "Traceback" not in errors, errors
    try:
        until(lambda: served.operating_state().state == "PAUSED", every=0.02)
    except AssertionError as error:
        raise AssertionError(f"{served.operating_state()} after exit {code}: {out}{errors}") from error
    until(lambda: _rests(served), seconds=10.0)  # setpoints come by another topic than the state, maybe later
    assert np.abs(served.setpoint_js().q - begin).max() > 1e-3
    if number == signal.SIGKILL:  # the server paused it
        assert code == -number
        return
    assert code == (0 if command == "teleop" else 128 + number), errors
    if command in ("excite", "calibrate"):
        said = "interrupted" if number == signal.SIGINT else f"ended by {number.name}"
        assert said in errors
        return
    summary = json.loads(out)
    assert summary["ended_by"] == {signal.SIGINT: "Ctrl-C"}.get(number, number.name), summary
    assert summary["state"]["state"] == "PAUSED"


def _rests(served: CrtkClient) -> bool:
    """Return whether a robot's setpoint stays what it is for a tenth of a second."""
    held = served.setpoint_js().q
    served.transport.sleep(0.1)
    return np.array_equal(served.setpoint_js().q, held)


def _end_program(
    master: Master, served: CrtkClient, folder: Path, command: str, number: signal.Signals
) -> tuple[int, str, str]:
    with Program(master, PATIENT_COMMAND, *arguments(command, folder, served.setpoint_js().q[0])) as program:
        until(lambda: takes_signals(program.process.pid), every=0.05)
        begin = served.setpoint_js().q  # it sinks a little when a paused robot is resumed
        until(lambda: np.abs(served.setpoint_js().q - begin).max() > 5e-3, every=0.02)
        program.process.send_signal(number)
        out, errors = program.finish()
    return program.process.returncode, out, errors


def _end_teleop(
    master: Master, served: CrtkClient, folder: Path, command: str, number: signal.Signals
) -> tuple[int, str, str]:
    begin = served.setpoint_js().q
    key = b"q" if begin[0] < 0.6 else b"a"
    with Typist(*ROBOT, program=("-c", PATIENT_COMMAND), environment=master.environment) as typist:
        typist.wait_for(b"catenary teleop")
        typist.hold(key, lambda: np.abs(served.setpoint_js().q - begin).max() > 5e-3)
        typist.process.send_signal(number)
        if number == signal.SIGKILL:
            return typist.process.wait(), "", ""
        return 0, json.dumps(typist.end()), ""


def takes_signals(pid: int) -> bool:
    """Return whether a process takes SIGTERM: from then on it is the command itself that ends."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (mask,) = (line.split()[1] for line in lines if line.startswith("SigCgt"))
    return bool(int(mask, 16) >> (signal.SIGTERM - 1) & 1)


def left_in_session(session: int) -> list[int]:
    """Processes that a program, which began a session of its own, has left behind."""
    left = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = (Path("/proc") / name / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has ended meanwhile
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            left.append(int(name))
    return left
