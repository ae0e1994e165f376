"""Run programs of others, as they are, against a served PSM, and print what came out as a table.

    python -m tests.acceptance FOLDER [--over "ROS 1" --over "Kilted, DDS" ...] [--only dvrk_psm_test.py] [--page FILE]

FOLDER holds clones of jhu-dvrk/dvrk_python, collaborative-robotics/crtk_python_client and crtk_msgs. ROS 2 is an
environment that .ci/ros2 made with all of crtk_msgs; PyKDL is found by PYTHONPATH. With --page the rows that were run
take their places in a page's table.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dds import VARIABLES, free_domain
from ros import COMMAND, ROOT, running_master
from ros2 import DISTRIBUTIONS, place_of, sourced

# by name: clone, arguments, and whether the arm has to be enabled for them
PROGRAMS = {
    "dvrk_psm_test.py": ("dvrk_python", ("-a", "PSM1"), False),
    "dvrk_arm_test.py": ("dvrk_python", ("-a", "PSM1"), False),
    "dvrk_move_wait_test.py": ("dvrk_python", ("-a", "PSM1"), True),  # enables what is enabled
    "crtk_servo_jp_example.py": ("crtk_python_client", ("PSM1",), True),
    "crtk_move_cp_example.py": ("crtk_python_client", ("PSM1",), True),
}
# rows: distribution and how catenary speaks to it
OVER = {
    "ROS 1": ("1", "rospy"),
    **{f"{ros.capitalize()}, {by}": (ros, by.lower()) for ros in DISTRIBUTIONS for by in ("DDS", "rclpy")},
}
BEFORE = "<!-- made by `make acceptance` -->"  # the table in a page
EARLY, TRIES = "no data received yet", 5
LIMIT = 600.0  # [s] of a program
RATE = "200"  # [Hz] of what is served: a dVRK's is 100 to 200


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
    yield {**kept, **named}, [f"PYTHONPATH={os.pathsep.join([*places, *path])}", str(place_of(ros) / "bin" / "python")]


def outcome(ros: str, by: str, program: str, programs: Path) -> str:
    """Serve a PSM, run a program against it and say how it ended."""
    clone, given, enabled = PROGRAMS[program]
    with tempfile.TemporaryDirectory() as name, network(ros, programs, Path(name)) as (environment, (path, python)):
        arguments = ["serve", "--robot", "dvrk_psm", "--homed", "--rate", RATE, "--ros", "1" if ros == "1" else "2"]
        ours = {**environment, "PYTHONPATH": str(ROOT / "src")}
        if ros != "1":
            arguments += ["--transport", by]
        if by == "rclpy":
            ours |= {key: value for key, value in sourced(ros).items() if os.environ.get(key) != value}
        with subprocess.Popen(
            [sys.executable, "-u", "-c", COMMAND, *arguments, *(["--start"] if enabled else [])],
            env=ours, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        ) as server:  # fmt: skip
            assert server.stdout is not None
            server.stdout.readline()  # it runs
            begin = time.monotonic()
            try:
                found = subprocess.run(
                    ["env", path, python, programs / clone / "scripts" / program, *given],
                    env=environment, input="\n" * 100, capture_output=True, text=True, timeout=LIMIT, check=False,
                )  # fmt: skip
                ended = f"{found.returncode}, {time.monotonic() - begin:.0f} s"
                if found.returncode:
                    said = (found.stderr.strip() or found.stdout.strip()).splitlines()
                    ended += f": {'; '.join(line for line in said if 'Error' in line or ' ! ' in line) or said[-1]}"
            except subprocess.TimeoutExpired:
                ended = f"no end within {LIMIT:.0f} s"
            finally:
                server.terminate()
                server.stdout.read()
    return ended


def tried(ros: str, by: str, program: str, programs: Path) -> str:
    """Return how a program ended, tried again where it read before any data could reach it: see docs/crtk.md."""
    count, ended = 1, outcome(ros, by, program, programs)
    while EARLY in ended and count < TRIES:
        count, ended = count + 1, outcome(ros, by, program, programs)
    return ended if count == 1 else f"{ended}, try {count}"


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def into_page(page: Path, rows: dict[str, str], head: str) -> None:
    """Put rows into a page's table, in place of those that it has of the same name."""
    before, _, rest = page.read_text(encoding="utf-8").partition(f"{BEFORE}\n")
    lines = rest.splitlines(keepends=True)
    count = next(k for k, line in enumerate([*lines, ""]) if not line.startswith("|"))
    table, after = "".join(lines[:count]), "".join(lines[count:])
    known = (
        {line.split(" | ")[0].strip("| "): line for line in table.splitlines()[2:]} if table.startswith(head) else {}
    )
    found = [line for name in OVER if (line := {**known, **rows}.get(name))]
    page.write_text(f"{before}{BEFORE}\n" + "\n".join([head, *found]) + f"\n{after}", encoding="utf-8")


def main() -> int:
    """Print the table; return how many ended otherwise than well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--over", action="append", choices=OVER)
    parser.add_argument("--only", action="append", choices=PROGRAMS)
    parser.add_argument("--page", type=Path)
    asked = parser.parse_args()
    programs, rows = asked.only or list(PROGRAMS), {}
    head = f"| exit code, time | {' | '.join(f'`{one}`' for one in programs)} |\n|---|{'---|' * len(programs)}"
    say(head)
    faults = 0
    for name in asked.over or OVER:
        cells = [tried(*OVER[name], program, asked.folder.resolve()) for program in programs]
        faults += sum(not cell.startswith("0,") for cell in cells)
        rows[name] = f"| {name} | {' | '.join(cells)} |"
        say(rows[name])
        if asked.page is not None:
            into_page(asked.page, rows, head)
    return faults


if __name__ == "__main__":
    sys.exit(main())
