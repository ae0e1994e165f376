"""Run programs of others, as they are, against the served arms of a dVRK, three times each, and print a table of it.

    python -m tests.acceptance FOLDER [--over "ROS 1" --over "Kilted, DDS" ...] [--only dvrk_psm_test.py] [--times N]
        [--page FILE]

FOLDER holds clones of jhu-dvrk/dvrk_python, collaborative-robotics/crtk_python_client and crtk_msgs. ROS 2 is an
environment that .ci/ros2 made with all of crtk_msgs; PyKDL is found by PYTHONPATH. With --page what was run takes its
place in a page's table.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from dds import VARIABLES, free_domain
from ros import COMMAND, ROOT, running_master
from ros2 import DISTRIBUTIONS, place_of, sourced


@dataclass(frozen=True)
class Program:
    """A program of others, what is served to it, and who works with it."""

    clone: str
    arguments: tuple[str, ...]
    serves: tuple[str, ...] = ("dvrk_psm",)
    enabled: bool = False  # whether the arms have to be
    person: str = ""  # what a person does meanwhile, a program; one without an end is interrupted after it


# what a person does begins with this: pedals, and the hand of an operator; as the server speaks, since two programs of
# Fast DDS on one machine, beside servers of Cyclone DDS, may not hear each other, and Kilted's is slow beside Cyclone's
_PERSON = """
import sys, time
import numpy as np
from catenary.crtk.message import message_class
from catenary.crtk.network import make_transport
if sys.argv[1] == "rclpy":
    from catenary.crtk.rclpy_transport import RclpyTransport
    transport = RclpyTransport("person")
else:
    transport = make_transport("1" if sys.argv[1] == "rospy" else "2", "person")
Joy, JointState = (message_class(f"sensor_msgs/{name}") for name in ("Joy", "JointState"))
WrenchStamped, Wrench, Vector3 = (message_class(f"geometry_msgs/{name}") for name in ("WrenchStamped", "Wrench", "Vector3"))
pedals = {name: transport.publisher(f"/footpedals/{name}", "sensor_msgs/Joy") for name in ("coag", "clutch")}
def press(name, value):
    pedals[name].publish(Joy(axes=[0.0], buttons=[value]))
print("here", flush=True)
"""
_PEDALS = (
    _PERSON
    + """
while True:
    for value in (1, 0):
        press("coag", value)
        time.sleep(0.4)
"""
)
# is there, pinches, carries the master by its gripper, clutches, and looks whether the slave has followed
_OPERATOR = (
    _PERSON
    + """
NAMES = "/MTMR/measured_cp", "/PSM1/setpoint_cp"
ears = {name: transport.subscribe(name, "geometry_msgs/PoseStamped", depth=1) for name in NAMES}
ears["jaw"] = transport.subscribe("/PSM1/jaw/setpoint_js", "sensor_msgs/JointState", depth=1)
hand = transport.publisher("/MTMR/hand/servo_cf", "geometry_msgs/WrenchStamped")
fingers = transport.publisher("/MTMR/hand/servo_jp", "sensor_msgs/JointState")
last = {}
def newest(name):
    for received in ears[name].take():
        last[name] = received.message
    return last.get(name)
def at(name):
    return np.array(tuple(newest(name).pose.position))
def jaw():
    return float(newest("jaw").position[0])
def moved(before):
    return [1e3 * np.linalg.norm(at(name) - place) for name, place in before.items()]
def for_a_while(seconds, do, until=lambda: False):
    end = time.time() + seconds
    while time.time() < end and not until():
        press("coag", 1)
        do()
        time.sleep(0.02)
def grip(angle):
    fingers.publish(JointState(position=[angle]))
def carry(way, seconds):
    "Pull the master there as by a spring with a damper."
    goal, before, then = at(NAMES[0]) + way, at(NAMES[0]), time.time()
    def pull():
        nonlocal before, then
        place, now = at(NAMES[0]), time.time()
        force = 30.0 * (goal - place) - 10.0 * (place - before) / max(now - then, 0.01)
        hand.publish(WrenchStamped(wrench=Wrench(force=Vector3(*force.tolist()))))
        before, then = place, now
    for_a_while(seconds, pull)
def has_followed():
    led, followed = moved(before)
    return abs(followed - 0.2 * led) < 0.5
while any(newest(name) is None for name in ears):
    time.sleep(0.1)
begin = time.time()
for_a_while(40.0, lambda: grip(0.8 if (time.time() - begin) % 2.0 < 1.0 else 0.1), until=lambda: jaw() > 0.5)
for_a_while(1.0, lambda: grip(0.8))
before = {name: at(name) for name in NAMES}
carry((0.01, 0.02, 0.03), 2.0)
time.sleep(0.5)
for_a_while(10.0, lambda: None, until=has_followed)  # a busy machine is late
led, followed = moved(before)
press("clutch", 1)
time.sleep(0.5)
clutched = {name: at(name) for name in NAMES}
carry((-0.01, -0.02, -0.03), 2.0)
time.sleep(1.0)
free, still = moved(clutched)
press("clutch", 0)
print(f"led {led:.1f} mm, followed {followed:.1f} mm, jaw {jaw():.2f} rad; clutched {free:.1f} mm, followed {still:.1f} mm")
as_asked = led > 5.0 and abs(followed - 0.2 * led) < 0.5 and jaw() > 0.9 and free > 5.0 and still < 0.5
transport.close()
sys.exit(0 if as_asked else 1)
"""
)
_DVRK = "dvrk_python"
PROGRAMS = {
    "dvrk_psm_test.py": Program(_DVRK, ("-a", "PSM1")),
    "dvrk_arm_test.py": Program(_DVRK, ("-a", "PSM1")),
    "dvrk_arm_test.py -a ECM": Program(_DVRK, ("-a", "ECM"), ("dvrk_ecm",)),
    "dvrk_mtm_test.py": Program(_DVRK, ("-a", "MTMR"), ("dvrk_mtm",), person=_PEDALS),
    "dvrk_mtm_cartesian_impedance.py": Program(_DVRK, ("-a", "MTMR"), ("dvrk_mtm",), person=_PEDALS),
    "dvrk_teleoperation.py": Program(
        _DVRK, ("-m", "MTMR", "-p", "PSM1", "-i", "0.05"), ("dvrk_psm", "dvrk_mtm"), person=_OPERATOR
    ),
    "dvrk_move_wait_test.py": Program(_DVRK, ("-a", "PSM1"), enabled=True),  # enables what is enabled
    "crtk_servo_jp_example.py": Program("crtk_python_client", ("PSM1",), enabled=True),
    "crtk_move_cp_example.py": Program("crtk_python_client", ("PSM1",), enabled=True),
}
# rows: distribution and how catenary speaks to it
OVER = {
    "ROS 1": ("1", "rospy"),
    **{f"{ros.capitalize()}, {by}": (ros, by.lower()) for ros in DISTRIBUTIONS for by in ("DDS", "rclpy")},
}
BEFORE = "<!-- made by `make acceptance` -->"  # the table in a page
EARLY, TRIES = "no data received yet", 5
LIMIT = 600.0  # [s] of a program
RATE = "100"  # [Hz] of what is served: a dVRK's is 100 to 200


def recipe() -> str:
    """Return what docs/crtk-topics.md gives to make ROS 1's Python of crtk_msgs, by what Debian's genpy makes."""
    page = (ROOT / "docs" / "crtk-topics.md").read_text(encoding="utf-8")
    return next(block for block in page.split("```") if block.startswith("\nimport pathlib, sys"))


@contextmanager
def network(ros: str, programs: Path, folder: Path) -> Iterator[tuple[dict[str, str], list[str]]]:
    """Yield the environment of a network of its own, and how its Python is called with what the programs import."""
    places = [str(programs / "crtk_python_client" / "src"), str(programs / "dvrk_python" / "src")]
    path = [os.environ.get("PYTHONPATH", "")]
    if ros == "1":
        made = folder / "python"
        command = [sys.executable, "-c", recipe(), str(programs / "crtk_msgs"), str(made)]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(ROOT / "src")})
        with running_master(folder) as master:
            system = "/usr/lib/python3/dist-packages"
            whole = os.pathsep.join([str(made), *places, *path, system])
            yield {**master.environment, "ROS_VERSION": "1"}, [f"PYTHONPATH={whole}", sys.executable]
        return
    left_out = {*VARIABLES, "CYCLONEDDS_URI", "PYTHONPATH"}
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    named = {"ROS_VERSION": "2", "ROS_DOMAIN_ID": str(free_domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    named["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"  # shared memory of programs that were killed makes others deaf
    yield {**kept, **named}, [f"PYTHONPATH={os.pathsep.join([*places, *path])}", str(place_of(ros) / "bin" / "python")]


class Run(NamedTuple):
    """How a program ended."""

    seconds: float
    fault: str = ""  # none with exit code 0, and a person who saw what was to be seen

    def __str__(self) -> str:
        return f"{self.fault or 'well'}, {self.seconds:.0f} s"


def outcome(ros: str, by: str, name: str, programs: Path) -> Run:
    """Serve arms, run a program against them, with a person where it needs one, and say how it ended."""
    program = PROGRAMS[name]
    script = programs / program.clone / "scripts" / name.partition(" ")[0]
    with tempfile.TemporaryDirectory() as folder, network(ros, programs, Path(folder)) as (environment, (path, python)):
        theirs = ["env", path, python]
        with ExitStack() as opened:
            log = opened.enter_context((Path(folder) / "log").open("w+", encoding="utf-8"))
            for robot in program.serves:
                opened.enter_context(served(robot, ros, by, environment, log, enabled=program.enabled))
            if program.person:
                command = [sys.executable, "-c", program.person, by]
                person = opened.enter_context(running(command, ours(ros, by, environment), stdout=subprocess.PIPE))
                assert person.stdout is not None
                person.stdout.readline()  # the pedals are there before the program, which waits 5 s for all its topics
            begin = time.monotonic()
            ran = opened.enter_context(
                running(
                    [*theirs, script, *program.arguments], environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                )
            )  # fmt: skip
            watched = ""
            try:
                if program.person == _OPERATOR:
                    watched, _ = person.communicate(timeout=LIMIT)
                    ran.send_signal(signal.SIGINT)
                out, err = ran.communicate("\n" * 100, timeout=LIMIT)
            except subprocess.TimeoutExpired:
                return Run(LIMIT, "no end")
            seconds = time.monotonic() - begin
            if ran.returncode:
                lines = (err.strip() or out.strip()).splitlines()
                marked = [line.strip() for line in lines if any(mark in line for mark in ("Error: ", " ! ", ": [/"))]
                reason = "; ".join(marked or lines[-1:])
                log.seek(0)
                warnings = [line for line in log.read().splitlines() if line and not line.startswith("note: ")]
                return Run(seconds, f"exit code {ran.returncode}: {reason}; server: {'; '.join(warnings)}")
            if program.person == _OPERATOR and person.returncode:
                return Run(seconds, f"did not follow: {watched.strip()}; {out.strip()}")
            return Run(seconds)


@contextmanager
def running(command: list[str | Path], environment: dict[str, str], **pipes: Any) -> Iterator[subprocess.Popen[str]]:
    """Yield a process that is ended on leaving."""
    with subprocess.Popen(command, env=environment, text=True, **{"stderr": subprocess.DEVNULL, **pipes}) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.communicate()


def ours(ros: str, by: str, environment: dict[str, str]) -> dict[str, str]:
    """Return the environment of a program of ours in a network."""
    own = {**environment, "PYTHONPATH": str(ROOT / "src")}
    if by == "rclpy":
        own |= {key: value for key, value in sourced(ros).items() if os.environ.get(key) != value}
    return own


@contextmanager
def served(robot: str, ros: str, by: str, environment: dict[str, str], log: TextIO, *, enabled: bool) -> Iterator[None]:
    """Serve an arm until left; its log goes to a file."""
    arguments = [
        "serve",
        "--robot",
        robot,
        "--name",
        robot,
        "--homed",
        "--rate",
        RATE,
        "--ros",
        "1" if ros == "1" else "2",
    ]
    if ros != "1":
        arguments += ["--transport", by]
    command: list[str | Path] = [sys.executable, "-u", "-c", COMMAND, *arguments, *(["--start"] if enabled else [])]
    with running(
        command, ours(ros, by, environment), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log
    ) as server:
        assert server.stdout is not None
        server.stdout.readline()  # it runs
        yield


def tried(ros: str, by: str, program: str, programs: Path) -> Run:
    """Return how a program ended, tried again where it read before any data could reach it: see docs/crtk.md."""
    for _ in range(TRIES - 1):
        run = outcome(ros, by, program, programs)
        if EARLY not in run.fault:
            return run
    return outcome(ros, by, program, programs)


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def cell(runs: Sequence[Run]) -> str:
    """Return how many runs of a program ended well, and the slowest one's time [s]."""
    return f"{sum(not run.fault for run in runs)}/{len(runs)}, {max(run.seconds for run in runs):.0f}"


def table(cells: Mapping[tuple[str, str], str]) -> list[str]:
    """Return a table of cells by program and network."""
    columns, rows = ([name for name in names if any(name in place for place in cells)] for names in (OVER, PROGRAMS))
    head = [f"| ended well, slowest in s | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    return head + [f"| `{row}` | {' | '.join(cells.get((row, name), '-') for name in columns)} |" for row in rows]


def into_page(page: Path, cells: Mapping[tuple[str, str], str]) -> None:
    """Put cells into a page's table, beside those that it has."""
    before, _, rest = page.read_text(encoding="utf-8").partition(f"{BEFORE}\n")
    lines = rest.splitlines()
    count = next(k for k, line in enumerate([*lines, ""]) if not line.startswith("|"))
    (_, *columns), _, *rows = ([part.strip() for part in line.strip("|").split("|")] for line in lines[:count])
    known = {(row[0].strip("`"), name): text for row in rows for name, text in zip(columns, row[1:], strict=True)}
    made = "\n".join([*table({**known, **cells}), *lines[count:], ""])
    page.write_text(f"{before}{BEFORE}\n{made}", encoding="utf-8")


def main() -> int:
    """Print how each program ended, and the table; return how many ended otherwise than well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--over", action="append", choices=OVER)
    parser.add_argument("--only", action="append", choices=PROGRAMS)
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a job in a shell's background ignores it, and its programs
    cells, faults = {}, 0
    for over in options.over or OVER:
        for program in options.only or PROGRAMS:
            runs = list[Run]()
            for _ in range(options.times):
                runs.append(tried(*OVER[over], program, options.folder.resolve()))
                say(f"{over}, {program}: {runs[-1]}")
            faults += sum(bool(run.fault) for run in runs)
            cells[program, over] = cell(runs)
            if options.page is not None:
                into_page(options.page, cells)
    say("\n".join(table(cells)))
    return faults


if __name__ == "__main__":
    sys.exit(main())
