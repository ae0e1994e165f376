"""An account that has no home and may write nothing of the package: a service's, or a container's with `-u 1000`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import catenary
from command_line import Outcome

NOBODY = "54321"  # has no line in /etc/passwd either, as in a container
# it may read whatever root may, Python among it, which may lie in root's home
DROP = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
DROP += [f"--{which}-caps=-all,+dac_read_search" for which in ("inh", "ambient")]


def installed(folder: Path) -> Path:
    """Copy the package to where no account but root's may write; return the folder to import it from."""
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("setpriv is not here, and root may write everywhere")
    package = folder / "site" / "catenary"
    shutil.copytree(Path(catenary.__file__).parent, package, ignore=shutil.ignore_patterns("*.nbi", "*.nbc"))
    for path in [package, *package.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    return package.parent


def run(site: Path, code: str, folder: Path, **environment: str) -> Outcome:
    """Run Python code in a folder that this account may write to, as it may to /tmp."""
    folder.chmod(0o1777)
    ended = subprocess.run(
        [*(DROP if os.geteuid() == 0 else []), sys.executable, "-c", code],
        cwd=folder,
        env={
            "PATH": os.environ["PATH"],
            "HOME": "/nonexistent",
            "PYTHONPATH": str(site),
            "NUMBA_OPT": "0",
            **environment,
        },
        capture_output=True,
        text=True,
        timeout=500.0,
        check=False,
    )
    return Outcome(ended.returncode, ended.stdout, ended.stderr)
