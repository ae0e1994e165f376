"""Programs killed (SIGKILL) at any moment: a recorder, a calibration, its commands.

Held is what docs/reliability.md says: of a recording half a second and what the disk took is lost at most, the project
opens and extracts, the same command again goes on to the same bits, and no process is left.
"""

import functools
import hashlib
import json
import mmap
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.campaign.part import Fell, Part

ROOT = Path(__file__).parents[3]
LONGEST = 1.0  # [s] of messages that a kill may cost: half a second, and as much for a busy machine
RECORDER = """
import mmap, os, sys, time
from pathlib import Path
import numpy as np
from catenary.recording.journal import JournalTopic, JournalWriter
from catenary.raven2.topics import raven_topics
from catenary.recording.layout import encode
from oracles.raven_recording import telemetry
os.fsync = lambda descriptor: None  # a program that is killed needs no disk, which may be busy
appended = mmap.mmap(os.open(sys.argv[2], os.O_RDWR), 8)
topics = raven_topics()
columns = telemetry(np.arange(2) * 0.01, np.random.default_rng(0))
messages = [(t.name, [m.tobytes() for m in encode(t, np.arange(2) + 1, columns)][0]) for t in topics]
begin, count = time.monotonic(), 0
with JournalWriter(Path(sys.argv[1]), [JournalTopic(t.name, t.type) for t in topics], max_bytes=300_000) as journal:
    print("ready", flush=True)
    while True:
        for name, data in messages:
            journal.append(name, time.time_ns(), data)
            count += 1
        appended[:] = count.to_bytes(8, "little")
        time.sleep(max(0.0, begin + count / 4 * 0.01 - time.monotonic()))
"""
CALIBRATION = """
import sys
from pathlib import Path
from simulated_project import calibrate_short
print("ready", flush=True)
calibrate_short(Path(sys.argv[1]), with_page=False)
"""
COMMANDS = (
    ("home",),
    ("excite", "--sparsity", "1"),
    ("record", "--hours", "0.01"),
    ("extract",),
    ("extract", "--bag", "ros1"),
)


def environment() -> dict[str, str]:
    paths = [str(ROOT / "src"), str(ROOT / "tests"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def killed(arguments: Sequence[str], seconds: float) -> bool:
    """Run a program and kill it so long after it says that it is ready; return whether it was still at work."""
    from ended_commands import left_in_session

    with subprocess.Popen(
        [sys.executable, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(),
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            if arguments[0] == "-c" and process.stdout.readline() != b"ready\n":
                raise Fell(f"did not begin: {process.communicate()[1].decode()[-1000:]}")
            time.sleep(seconds)
            was_at_work = process.poll() is None
        finally:
            process.kill()
            process.wait()
    if left := left_in_session(process.pid):
        raise Fell(f"processes {left} are left")
    return was_at_work


def ran(arguments: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment(), check=False)


def whole_run(arguments: Sequence[str]) -> str:
    done = ran(arguments)
    if done.returncode:
        raise Fell(f"{' '.join(arguments[-4:])}: exit {done.returncode}: {done.stderr[-2000:]}")
    return done.stdout


def recorder(seed: int, folder: Path) -> None:
    """Kill a recorder; rescue what it recorded in a project and outside, beside a recording that is whole."""
    from catenary.recording.bag_reader import JournalReader
    from catenary.workflows.project.calibrate import extract_recording, motion_log_path
    from catenary.workflows.project.folder import Project, ProjectSettings
    from catenary.workflows.recover import recover
    from oracles.raven_recording import record

    rng = random.Random(seed)
    project = Project(folder / "p", ProjectSettings())
    record(project.folder / "recordings" / "whole", 2.0)
    place, count = project.folder / "recordings" / "killed", folder / "count"
    count.write_bytes(bytes(8))
    killed(["-c", RECORDER, str(place), str(count)], rng.uniform(0.8, 4.0))
    with count.open("r+b") as file:
        appended = int.from_bytes(mmap.mmap(file.fileno(), 8)[:], "little")
    reader = JournalReader(place)
    there = sum(1 for _ in reader.messages())
    if appended - there > 400 * LONGEST:
        raise Fell(f"{appended - there} of {appended} messages are lost: {(appended - there) / 400:.2f} s")
    if reader.lost or not reader.ends_early:
        raise Fell(f"{reader.lost} lost in between: {reader.problems}")
    for name in ("killed", "whole"):
        if name == "whole" or there > 50:
            extract_recording(project, name)
            motion_log_path(project, name).stat()
    if there > 50:
        report = json.loads((project.folder / "killed.synchronised.json").read_text())
        if sum(one["kept"] for one in report["rescued"]["topics"]) != there:
            raise Fell(f"{report['rescued']}, but {there} are there")
    found = recover(place, folder / "recovered")
    if found.written is None or sum(1 for _ in JournalReader(found.written).messages()) != there:
        raise Fell(f"recover kept another number than {there}")


def results(folder: Path) -> dict[str, str]:
    """Return the hashes of what a calibration ends with, but for what its own time is in."""
    files = [*folder.glob("*.parquet"), *(folder / "models").glob("*.npz"), *(folder / "robot").glob("*")]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@functools.cache
def reference() -> tuple[dict[str, str], float]:
    """A calibration that nobody kills: its results, and how long it takes [s]."""
    folder = Path(tempfile.mkdtemp(prefix="campaign-kills-")) / "p"
    whole_run(["-c", CALIBRATION, str(folder)])  # compiles
    begin = time.monotonic()
    whole_run(["-c", CALIBRATION, str(folder.with_name("q"))])
    return results(folder), time.monotonic() - begin


def calibrate(seed: int, folder: Path) -> None:
    """Kill a calibration with short motions once or twice, then let it end: the same bits as if nobody had."""
    from catenary.workflows.project.folder import Project, project_settings

    expected, seconds = reference()
    rng = random.Random(seed)
    for _ in range(rng.randint(1, 2)):
        if not killed(["-c", CALIBRATION, str(folder / "p")], rng.uniform(0.0, seconds)):
            break
        settings = project_settings(folder / "p") if (folder / "p").is_dir() else None
        if settings is not None:
            Project(folder / "p", settings)
    whole_run(["-c", CALIBRATION, str(folder / "p")])
    found = results(folder / "p")
    if found != expected:
        differ = sorted(name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name))
        raise Fell(f"{', '.join(differ)} differ")
    if left := list((folder / "p").rglob("*.partial")):
        raise Fell(f"{left[0].name} is left")


def commands(seed: int, folder: Path) -> None:
    """Kill a command of a project; extract what is there, then run it again."""
    rng = random.Random(seed)
    hit = seed % len(COMMANDS)
    for number, (command, *options) in enumerate(COMMANDS):
        arguments = ["-m", "catenary.cli.main", command, str(folder / "p"), *options]
        if number == hit:
            killed(arguments, rng.uniform(0.5, 8.0))
            if hit in (1, 2):
                _extract_what_is_there(folder / "p")
        whole_run(arguments)
    found = json.loads(whole_run(["-m", "catenary.cli.main", "extract", str(folder / "p"), "--json"]))
    if sorted(found) != ["test", "train"] or any(one["rescued"] for one in found.values()):
        raise Fell(f"not whole in the end: { {name: one['rescued'] for name, one in found.items()} }")


def _extract_what_is_there(folder: Path) -> None:
    done = ran(["-m", "catenary.cli.main", "extract", str(folder), "--json"])
    if "Traceback" in done.stderr or done.returncode not in (0, 2):
        raise Fell(f"extract: exit {done.returncode}: {done.stderr[-2000:]}")
    whole = (folder / "recordings" / "test").is_dir()
    if whole and done.returncode:
        raise Fell(f"an interrupted recording blocks others: {done.stderr[-1000:]}")


PARTS = (
    Part("kills.recorder", 40, recorder, warnings_fail=False, processor_time=30.0, memory=2 * 10**9),
    Part("kills.calibrate", 20, calibrate, warnings_fail=False, processor_time=600.0, patience=1200.0, memory=None),
    Part("kills.commands", 20, commands, warnings_fail=False, processor_time=600.0, patience=1200.0, memory=None),
)
