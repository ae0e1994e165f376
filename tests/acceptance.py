"""Run dVRK's own test programs, as they are, against a served PSM, and print what came out as a table.

    python -m tests.acceptance FOLDER [--ros 1] [--ros kilted] [--ros jazzy] [--only dvrk_psm_test.py]

FOLDER holds clones of jhu-dvrk/dvrk_python and collaborative-robotics/crtk_python_client, for ROS 1 also of crtk_msgs.
ROS 2 is an environment that .ci/ros2 made, with the whole of crtk_msgs built in it; PyKDL is found by PYTHONPATH.
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

from dds import LOOPBACK, VARIABLES, free_domain
from ros import COMMAND, ROOT, running_master
from ros2 import DISTRIBUTIONS

PROGRAMS = ("dvrk_psm_test.py", "dvrk_arm_test.py")
LIMIT = 600.0  # [s] of a program
# ROS 1's Python of a package of messages, by what Debian's genpy makes
MAKE_MESSAGES = """
import pathlib, sys
from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.recording.messages import MESSAGES, full_definition
make_rospy_importable()
from genpy import generate_initpy, generator
package, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
for name in MESSAGES:
    target = out / "share" / f"{name.replace('/', '/msg/')}.msg"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(full_definition(name).partition("=" * 80)[0])
within = {one.name: [str(one / "msg")] for one in (out / "share").iterdir()} | {package.name: [str(package / "msg")]}
for kind, make in (("msg", generator.MsgGenerator()), ("srv", generator.SrvGenerator())):
    target = out / package.name / kind
    target.mkdir(parents=True, exist_ok=True)
    make.generate_messages(package.name, map(str, (package / kind).glob(f"*.{kind}")), str(target), within)
    generate_initpy.write_modules(str(target))
(out / package.name / "__init__.py").touch()
"""


@contextmanager
def network(ros: str, programs: Path, folder: Path) -> Iterator[tuple[dict[str, str], list[str]]]:
    """Yield the environment of a network of its own, and how its Python is called with what the programs import."""
    places = [str(programs / "crtk_python_client" / "src"), str(programs / "dvrk_python" / "src")]
    path = [os.environ.get("PYTHONPATH", "")]
    if ros == "1":
        made = folder / "python"
        command = [sys.executable, "-c", MAKE_MESSAGES, str(programs / "crtk_msgs"), str(made)]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(ROOT / "src")})
        with running_master(folder) as master:
            system = "/usr/lib/python3/dist-packages"
            whole = os.pathsep.join([str(made), *places, *path, system])
            yield {**master.environment, "ROS_VERSION": "1"}, [f"PYTHONPATH={whole}", sys.executable]
        return
    left_out = {*VARIABLES, "CYCLONEDDS_URI", "PYTHONPATH"}
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    named = {"ROS_VERSION": "2", "ROS_DOMAIN_ID": str(free_domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    env = os.environ.get(f"CATENARY_{ros.upper()}", str(ROOT / ".cache" / ros))
    yield {**kept, **named}, [f"PYTHONPATH={os.pathsep.join([*places, *path])}", f"{env}/bin/python"]


def outcome(ros: str, program: str, programs: Path) -> str:
    """Serve a PSM, run a program against it and say how it ended."""
    with tempfile.TemporaryDirectory() as name, network(ros, programs, Path(name)) as (environment, (path, python)):
        arguments = ["serve", "--robot", "dvrk_psm", "--homed", "--ros", "1" if ros == "1" else "2"]
        ours = {**environment, "PYTHONPATH": str(ROOT / "src")}
        if ros != "1":
            ours["CYCLONEDDS_URI"] = LOOPBACK
        with subprocess.Popen(
            [sys.executable, "-u", "-c", COMMAND, *arguments],
            env=ours, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        ) as server:  # fmt: skip
            assert server.stdout is not None
            server.stdout.readline()  # it runs
            begin = time.monotonic()
            try:
                found = subprocess.run(
                    ["env", path, python, programs / "dvrk_python" / "scripts" / program, "-a", "PSM1"],
                    env=environment, input="\n" * 100, capture_output=True, text=True, timeout=LIMIT, check=False,
                )  # fmt: skip
                ended = f"exit code {found.returncode}, {time.monotonic() - begin:.0f} s"
                if found.returncode:
                    ended += f": {(found.stderr.strip() or found.stdout.strip()).splitlines()[-1]}"
            except subprocess.TimeoutExpired:
                ended = f"no end within {LIMIT:.0f} s"
            finally:
                server.terminate()
                server.stdout.read()
    return ended


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    """Print the table; return how many ended otherwise than well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--ros", action="append", choices=("1", *DISTRIBUTIONS))
    parser.add_argument("--only", action="append", choices=PROGRAMS)
    asked = parser.parse_args()
    programs = asked.only or PROGRAMS
    say(f"| | {' | '.join(f'`{one}`' for one in programs)} |\n|---|{'---|' * len(programs)}")
    faults = 0
    for ros in asked.ros or ("1", *DISTRIBUTIONS):
        cells = [outcome(ros, program, asked.folder.resolve()) for program in programs]
        faults += sum(not cell.startswith("exit code 0") for cell in cells)
        name = "ROS 1 (Debian's rospy)" if ros == "1" else f"ROS 2 {ros.capitalize()} (Fast DDS), over DDS"
        say(f"| {name} | {' | '.join(cells)} |")
    return faults


if __name__ == "__main__":
    sys.exit(main())
