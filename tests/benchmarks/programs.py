"""Programs over ROS 1, measured from outside: what they are told, what they take, and how it is printed."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from catenary.crtk.ros1.find_rospy import make_rospy_importable
from catenary.errors import MissingPackageError

CATENARY = "import sys; from catenary.cli.main import main; sys.argv[0] = 'catenary'; main()"


def options(about: str | None, **choices: tuple[str, ...]) -> argparse.Namespace:
    """Give `--seconds`, `--json`, and of each choice those that were asked for, or all; ends where there is no rospy."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seconds", type=float, default=20.0)
    for name, known in choices.items():
        parser.add_argument(f"--{name}", choices=known, action="append")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    for name, known in choices.items():
        setattr(given, name, getattr(given, name) or known)
    try:
        make_rospy_importable()
    except MissingPackageError as error:
        sys.exit(str(error))
    return given


def tell(tables: dict[str, dict[str, Any]], path: Path | None) -> None:
    """Print the tables, and write them as JSON where a path is given."""
    for title, row in tables.items():
        print(title)
        for key, value in row.items():
            print(f"  {key:22}{value:14.4g}")
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(tables, indent=2))


def memory(pid: int) -> float:
    """Resident memory of a process [MB]."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def cpu_seconds(pid: int) -> float:
    """Processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0
