import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree

import pytest

from made_once import made_once

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make docs` does, elsewhere, with every way to another machine closed."""
    return made_once(tmp_path_factory, "site", _built)


def _built(folder: Path) -> Path:
    copytree(ROOT / "docs", folder / "docs")
    for name in ("website", "src"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "zensical.toml").write_text((ROOT / "zensical.toml").read_text())
    closed = {f"{name}_proxy": "http://127.0.0.1:9" for name in ("http", "https", "all")}
    ended = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=folder, env={**os.environ, **closed}, capture_output=True, text=True,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return folder / "build" / "site"
