"""Recorders of a served robot over ROS 1, killed (SIGKILL) at any moment: `record`, which moves it, and `--no-motion`.

Held is what docs/reliability.md says: half a second of messages is lost at most, `catenary extract` takes what is whole
and others' recordings with it, the robot holds and is PAUSED, the same command again goes on, and no process is left.
"""

import functools
import json
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaign.part import PROGRAMS, Fell, Part
from tests.campaign.parts.kills import LONGEST, environment, killed, whole_run
from tests.campaign.parts.signals import ros1_is_installed, served

if TYPE_CHECKING:
    from catenary.recording.journal_reader import JournalReader

PAUSED_AFTER = 6.0  # [s] from the kill: the documented 3, and as much for a busy machine
HOURS = "0.004"
ROBOT = ("--ros", "1", "--simulated")
CATENARY = """
import sys, patience
from catenary.cli.main import main
patience.lengthen_limits()
"""
# a recording to train on as short as one can be
EXCITE = f"""{CATENARY}
from catenary.trajectories.smoothed_path import follow_waypoints
from catenary.workflows.project import calibrate
way = [[0.52, 1.57, 0.40], [0.7, 1.5, 0.395], [0.6, 1.7, 0.39], [0.52, 1.57, 0.40]]
calibrate.excitation = lambda project: (follow_waypoints(way, speed=[0.2, 0.2, 0.01]), "a stroll")
main()
"""
# tells how many messages its journal was given, and when the first and the last of them had arrived [ns]
RECORD = f"""{CATENARY}
import mmap, os, struct
from catenary.recording.journal import JournalWriter
os.fsync = lambda descriptor: None  # a program that is killed needs no disk, which may be busy
told, ready_when = mmap.mmap(os.open(sys.argv.pop(1), os.O_RDWR), 24), sys.argv.pop(1)
append, count, first = JournalWriter.append, 0, 0
def counted(journal, topic, stamp, data):
    global count, first
    append(journal, topic, stamp, data)
    first, count = first or stamp, count + 1
    told[:] = struct.pack("<3q", count, first, stamp)
    if count == 1 and ready_when == "it records":
        print("ready", flush=True)
JournalWriter.append = counted
if ready_when == "it begins":
    print("ready", flush=True)
main()
"""
# moves the robot beside a recorder; commands are nodes of the same name, and ROS 1 has one of a name
MOVER = f"""{CATENARY}
from catenary.crtk import network
make_transport = network.make_transport
network.make_transport = lambda ros, name: make_transport(ros, f"{{name}}_beside")
main()
"""


@functools.cache
def _trained() -> Path:
    """A project with a recording to train on, of the served robot; not to be written."""
    served()
    folder = Path(tempfile.mkdtemp(prefix="campaign-kills-")) / "p"
    whole_run(["-c", EXCITE, "excite", str(folder), "--yes", *ROBOT])
    return folder


def moving(rng: random.Random, project: Path) -> None:
    """Kill `catenary record`, which moves the robot; extract what is there, then run it again."""
    shutil.copytree(_trained(), project)
    command = ["record", str(project), "--hours", HOURS, "--yes", "--simulated"]
    recording = project / "recordings" / "test"
    there = _killed_recorder(rng, recording, command)
    _check_paused()
    if _extracted(project, "test", there)["train"]["rescued"]:
        raise Fell("another recording is said to be rescued")
    was_whole, had_begun = there is not None and not there.ends_early, recording.is_dir()
    whole_run(["-c", f"{CATENARY}main()", *command])
    _check_paused()
    found = json.loads(whole_run(["-c", f"{CATENARY}main()", "extract", str(project), "--json"]))
    if sorted(found) != ["test", "train"] or any(one["rescued"] for one in found.values()):
        raise Fell(f"not whole in the end: { {name: one['rescued'] for name, one in found.items()} }")
    if had_begun and not was_whole:
        kept = _journal(project / "replaced" / "test")
        if (kept and kept.received) != (there and there.received):
            raise Fell(f"replaced/test is not what was recorded: {kept and kept.problems}")


def beside(rng: random.Random, project: Path) -> None:
    """Kill `catenary record --no-motion` beside a program that moves the robot, which goes on; record another."""
    from ended_commands import takes_signals
    from patience import until
    from ros import Program

    master, robot = served()
    if robot.operating_state().state != "ENABLED":
        robot.state_command("resume")
    with Program(master, MOVER, "random", "--seconds", "600", "--json", *ROBOT) as mover:
        until(lambda: takes_signals(mover.process.pid), every=0.05)
        _wait_until_it_moves()
        command = ["record", str(project), "--no-motion", "--hours", HOURS, *ROBOT, "--name"]
        recording = project / "recordings" / "hand"
        there = _killed_recorder(rng, recording, [*command, "hand"])
        _wait_until_it_moves()  # nobody else is disturbed
        _extracted(project, "hand", there)
        expected = 2 if recording.is_dir() and any(recording.iterdir()) else 0  # a name that is taken is refused
        again = _catenary(*command, "hand")
        if again.returncode != expected or (expected and "give this one another --name" not in again.stderr):
            raise Fell(f"the same again: exit {again.returncode}: {again.stderr[-2000:]}")
        whole_run(["-c", f"{CATENARY}main()", *command, "foot"])
        found = json.loads(whole_run(["-c", f"{CATENARY}main()", "extract", str(project), "--json"]))
        if found["foot"]["rescued"]:
            raise Fell(f"foot is not whole: {found['foot']['rescued']}")
        _wait_until_it_moves()
        mover.interrupt()
        mover.finish()
    _check_paused()


def ros1(seed: int, folder: Path) -> None:
    """Kill a recorder: each fourth one moves nothing itself."""
    (beside if seed % 4 == 3 else moving)(random.Random(seed), folder / "p")


def _killed_recorder(rng: random.Random, recording: Path, command: list[str]) -> "JournalReader | None":
    """Kill a recorder before or while it records; return what its journal holds, if it holds anything."""
    told = recording.parents[2] / "told"
    told.write_bytes(bytes(24))
    ready_when = "it begins" if rng.random() < 0.25 else "it records"
    killed(["-c", RECORD, str(told), ready_when, *command], rng.uniform(0.0, 10.0))
    count, first, last = struct.unpack("<3q", told.read_bytes())
    there = _journal(recording)
    if there is None or not any(there.received.values()):
        if last - first > 1e9 * LONGEST:
            raise Fell(f"all of {count} messages are lost: {1e-9 * (last - first):.2f} s")
        return there
    *_, (_, newest, _) = there.messages()
    if last - newest > 1e9 * LONGEST:
        kept = sum(there.received.values())
        raise Fell(f"{count - kept} of {count} messages are lost: {1e-9 * (last - newest):.2f} s")
    if there.lost:
        raise Fell(f"{there.lost} are lost in between: {there.problems}")
    return there


def _journal(recording: Path) -> "JournalReader | None":
    """Return a journal that has been read to its end; None where it was not begun."""
    from catenary.errors import FileFormatError
    from catenary.recording.journal_reader import JournalReader

    try:
        reader = JournalReader(recording)
    except FileFormatError:
        return None
    for _ in reader.messages():
        pass
    return reader


def _extracted(project: Path, name: str, there: "JournalReader | None") -> dict[str, Any]:
    """Extract a project right after the kill; it takes what is whole, says what is lost, and goes on with others."""
    done = _catenary("extract", str(project), "--json")
    recordings = {path.name for path in (project / "recordings").glob("*") if path.is_dir()}
    if "Traceback" in done.stderr or done.returncode != (0 if recordings - {name} else done.returncode):
        raise Fell(f"extract: exit {done.returncode}: {done.stderr[-2000:]}")
    found: dict[str, Any] = json.loads(done.stdout) if done.stdout.strip() else {}
    kept = {} if there is None else there.received
    if name not in found:
        # a log needs a second of the robot's state and of the encoders
        if len(kept) > 0 and min(kept.values()) > 50:
            raise Fell(f"{name} has {kept}, but is left out: {done.stderr[-2000:]}")
        if name in recordings and name not in done.stderr:
            raise Fell(f"nothing is said of {name}: exit {done.returncode}: {done.stderr[-2000:]}")
        return found
    rescued = found[name]["rescued"]
    if there is None or bool(rescued) != there.ends_early:
        raise Fell(f"{name}: {rescued}, but there are {kept}")
    if rescued and {one["topic"]: one["kept"] for one in rescued["topics"]} != kept:
        raise Fell(f"{name}: {rescued}, but there are {kept}")
    if rescued and not any("rescued" in problem for problem in found[name]["problems"]):
        raise Fell(f"{name}: no problem says that it was rescued: {found[name]['problems']}")
    return found


def _catenary(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", f"{CATENARY}main()", *arguments],
        capture_output=True, text=True, env=environment(), check=False,
    )  # fmt: skip


def _check_paused() -> None:
    """It holds where it was a second after the kill, and is PAUSED; what it was sent before may yet come in."""
    from patience import until

    _, robot = served()

    def stands() -> bool:
        q = robot.setpoint_js().q
        robot.transport.sleep(0.3)
        return robot.operating_state().state == "PAUSED" and np.array_equal(robot.setpoint_js().q, q)

    begin = time.monotonic()
    robot.transport.sleep(1.0)
    held = robot.setpoint_js().q
    until(stands, every=0.02)
    seconds = time.monotonic() - begin
    if seconds > PAUSED_AFTER:
        raise Fell(f"it was PAUSED {seconds:.1f} s after the kill")
    if not np.array_equal(robot.setpoint_js().q, held):
        raise Fell(f"it did not hold: {held}, then {robot.setpoint_js().q}")


def _wait_until_it_moves() -> None:
    from patience import until

    _, robot = served()
    q = robot.setpoint_js().q
    until(lambda: np.abs(robot.setpoint_js().q - q).max() > 5e-3, every=0.02)


PARTS = (Part("kills.ros1", 8, ros1, **PROGRAMS),) if ros1_is_installed() else ()
