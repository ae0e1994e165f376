"""Programs over ROS 1, measured from outside: what they take."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.errors import MissingPackageError
from ros import Master, running_master


def require_rospy() -> None:
    """End where there is no rospy."""
    try:
        make_rospy_importable()
    except MissingPackageError as error:
        sys.exit(str(error))


@contextmanager
def master_and_folder() -> Iterator[tuple[Master, Path]]:
    """A master of the benchmark's own, and a folder for what it leaves."""
    with TemporaryDirectory() as folder, running_master(Path(folder)) as master:
        yield master, Path(folder)


def memory(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), float("nan"))


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0
