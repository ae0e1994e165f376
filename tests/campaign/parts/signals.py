"""Commands that move a robot, ended by signals at any moment: in simulation, and over ROS 1 where it is installed.

Held is what the table of docs/reliability.md says: the exit code, the robot holding and PAUSED, a project that reads, and
no process left.
"""

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.campaign.part import PROGRAMS, Fell, Part
from tests.campaign.parts.stalls import ros1_is_installed, served

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
SIMULATED = ("goto", "random", "follow", "excite", "calibrate", "track", "hold", "teleop")
LONGEST = 4.0  # [s] after the start of the command proper that a signal comes


def _arguments(command: str, folder: Path) -> list[str]:
    if command == "goto":
        return ["goto", "--q-deg", "45", "--speed", "0.1", "--json"]
    if command == "random":
        return ["random", "--seconds", "600", "--json"]
    if command == "follow":
        file = folder / "run.csv"
        file.write_text("time [s],shoulder [deg]\n0,30\n600,50\n")
        return ["follow", str(file), "--json"]
    if command == "track":
        return ["track", "raven2", "--motion", "random", "--seconds", "600", "--json"]
    if command == "hold":
        return ["hold", "raven2", "--seconds", "600", "--json"]
    return [command, str(folder / "project")]


def simulated(seed: int, folder: Path) -> None:
    """End a command that moves a simulated robot, or a project's, some time after it has begun."""
    from ended_commands import left_in_session, takes_signals
    from patience import until

    rng = random.Random(seed)
    command, number = SIMULATED[seed % len(SIMULATED)], NUMBERS[seed // len(SIMULATED) % len(NUMBERS)]
    if command == "teleop":
        _end_teleop(rng, number)
        return
    with subprocess.Popen(
        [sys.executable, "-m", "catenary.cli.main", *_arguments(command, folder)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            until(lambda: takes_signals(process.pid), every=0.01)
            time.sleep(rng.uniform(0.0, LONGEST))
            ended_first = process.poll() is not None
            process.send_signal(number)
            if rng.random() < 0.3 and number != signal.SIGINT:  # services and terminals send several
                time.sleep(0.05)
                process.send_signal(number)
            out, errors = process.communicate(timeout=100.0)
        finally:
            process.kill()
    where = f"{command}, {number.name}: "
    if ended_first:
        raise Fell(f"{where}ended by itself with {process.returncode}: {errors[-1000:]}")
    # in a shell 128 and the number are also those of a program that the signal itself has ended: a second one while
    # Python exits, or Ctrl-C while it ran a text, as imports do
    if process.returncode not in (-number, *((128 + number,) if number != signal.SIGKILL else ())):
        raise Fell(f"{where}exit code {process.returncode}: {errors[-2000:]}")
    if "Traceback" in errors:
        raise Fell(f"{where}{errors[-3000:]}")
    if number != signal.SIGKILL:
        _check_words(where, number, out, errors)
    if left := left_in_session(process.pid):
        raise Fell(f"{where}processes left: {left}")
    if command in ("excite", "calibrate"):
        _check_project(where, folder / "project")


def _check_words(where: str, number: signal.Signals, out: str, errors: str) -> None:
    """A summary says what ended the motion, and the robot's state; before the robot was there, a line says it."""
    if not out.strip():
        if ("interrupted" if number == signal.SIGINT else number.name) not in errors:
            raise Fell(f"{where}nothing says what ended it: {errors!r}")
        return
    summary = json.loads(out)
    if summary["ended_by"] != {signal.SIGINT: "Ctrl-C"}.get(number, number.name):
        raise Fell(f"{where}ended_by {summary['ended_by']}")
    if summary["state"]["state"] != "PAUSED":
        raise Fell(f"{where}the robot is left {summary['state']}")


def _check_project(where: str, project: Path) -> None:
    """It opens, its lock is free, and what stands in it is whole or says what makes it again."""
    from catenary.workflows.project.folder import FolderLock, Project, project_settings

    if not project.exists():
        return
    lock = FolderLock(project)
    lock.take()
    lock.release()
    settings = project_settings(project)
    if settings is not None:
        Project(project, settings)
    for path in project.rglob("*.json"):
        json.loads(path.read_text())
    extract = subprocess.run(
        [sys.executable, "-m", "catenary.cli.main", "extract", str(project)],
        capture_output=True,
        text=True,
        check=False,
        timeout=100.0,
    )
    if extract.returncode not in (0, 2) or "Traceback" in extract.stderr:
        raise Fell(f"{where}catenary extract then ended with {extract.returncode}: {extract.stderr[-2000:]}")


def _end_teleop(rng: random.Random, number: signal.Signals) -> None:
    from typist import Typist

    with Typist() as typist:
        typist.wait_for(b"catenary teleop")
        typist.type(b"q", times=rng.randrange(0, 30))
        typist.process.send_signal(number)
        if number == signal.SIGKILL:
            typist.process.wait(60.0)
            return
        end: dict[str, Any] = typist.end()
    if end["state"]["state"] != "PAUSED" or end["ended_by"] == "quit":
        raise Fell(f"teleop, {number.name}: {end}")


def ros1(seed: int, folder: Path) -> None:
    """End a command that moves a served robot over ROS 1; the robot is looked at from another process."""
    from ended_commands import OVER_ROS, end_over_ros

    command, number = OVER_ROS[seed % len(OVER_ROS)], NUMBERS[seed // len(OVER_ROS) % len(NUMBERS)]
    master, _, robot = served("1")
    end_over_ros(master, robot, folder, command, number)
    if (folder / "project").exists():
        _check_project(f"{command}, {number.name}: ", folder / "project")


PARTS = (
    Part("signals.simulated", 32, simulated, **PROGRAMS),
    *([Part("signals.ros1", 24, ros1, **PROGRAMS)] if ros1_is_installed() else []),
)
