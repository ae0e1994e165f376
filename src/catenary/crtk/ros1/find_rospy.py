"""Where rospy is: with ROS noetic, or with Debian 12 (`apt install python3-rospy python3-rosmaster`).

Where it lies outside this environment's path but belongs to this version of Python, that path is appended: behind
everything that is installed here, so it hides nothing.
"""

import importlib.util
import sys
from pathlib import Path

from catenary.errors import MissingPackageError

# where Debian and ROS noetic put it, for the system's Python
_FOLDERS = (Path("/usr/lib/python3/dist-packages"), Path("/opt/ros/noetic/lib/python3/dist-packages"))


def make_rospy_importable() -> None:
    """Find rospy, where need be outside this environment."""
    if importlib.util.find_spec("rospy") is not None:
        return
    if _system_python() == sys.version_info[:2]:
        for folder in _FOLDERS:
            if (folder / "rospy" / "__init__.py").is_file():
                sys.path.append(str(folder))
                importlib.invalidate_caches()
                return
    version = ".".join(map(str, sys.version_info[:2]))
    raise MissingPackageError(
        f"rospy: not found for Python {version}. On Debian 12, with its Python 3.11: apt install python3-rospy "
        "python3-rosmaster. Without ROS, the loopback transport carries messages within one process"
    )


def _system_python() -> tuple[int, int] | None:
    """Return the version of Python for which the system's packages are made."""
    try:
        name = Path("/usr/bin/python3").resolve(strict=True).name
        major, _, minor = name.removeprefix("python").partition(".")
        return int(major), int(minor)
    except (OSError, ValueError):
        return None
