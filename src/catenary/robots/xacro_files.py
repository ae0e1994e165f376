"""Xacro files, expanded by xacro itself: as Python's package, or as the command that ROS brings."""

import shutil
import subprocess
from pathlib import Path

from catenary.documents import MOST_XML
from catenary.errors import FileFormatError, MissingPackageError

LONGEST = 60.0  # [s]


def expanded_xacro(path: Path) -> bytes:
    """Return the URDF that xacro makes of a file with its default arguments; xacro runs expressions in the file."""
    try:
        import xacro
    except ImportError:
        text = _by_command(path)
    else:
        try:
            text = xacro.process_file(str(path)).toxml().encode()
        except Exception as error:  # any of an expression's in the file
            raise FileFormatError(f"{path}: xacro cannot expand it: {error}") from error
    if len(text) > MOST_XML:
        raise FileFormatError(f"{path}: expands to {len(text)} bytes, expected at most {MOST_XML}")
    return text


def _by_command(path: Path) -> bytes:
    command = shutil.which("xacro")
    if command is None:
        raise MissingPackageError(
            f"{path}: is a xacro file, and xacro is not installed: pip install xacro, or source ROS, or expand it "
            "elsewhere (xacro robot.urdf.xacro > robot.urdf) and load the result"
        )
    try:
        done = subprocess.run([command, str(path)], capture_output=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired as error:
        raise FileFormatError(f"{path}: xacro takes more than {LONGEST:g} s") from error
    if done.returncode != 0:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise FileFormatError(f"{path}: xacro cannot expand it: {''.join(last)}")
    return done.stdout
