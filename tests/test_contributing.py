"""The walks of CONTRIBUTING.md, each done as it is written on a copy of the package."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from shutil import copytree, ignore_patterns

import pytest

ROOT = Path(__file__).parents[1]


class Walk:
    """A section of CONTRIBUTING.md, and a copy of the package and its tests to follow it on."""

    def __init__(self, title: str, folder: Path) -> None:
        text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
        section = text.partition(f"### {title}")[2].partition("\n### ")[0]
        blocks = re.findall(r"^( *)```python\n(.*?)^ *```", section, flags=re.MULTILINE | re.DOTALL)
        self.code = [re.sub(f"^{indent}", "", block, flags=re.MULTILINE) for indent, block in blocks]
        self.src, self.tests = folder / "src" / "catenary", folder / "tests"
        for kept in (self.src, self.tests):
            copytree(ROOT / kept.relative_to(folder), kept, ignore=ignore_patterns("__pycache__"))
        (folder / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
        self._folder = folder

    def add_line(self, file: str, after: str, line: str) -> None:
        """Add a line to a file of the package, below the one that begins with `after`."""
        path = self.src / file
        text, found = re.subn(f"^{re.escape(after)}.*\n", lambda at: at[0] + line, path.read_text(), flags=re.MULTILINE)
        assert found == 1
        path.write_text(text)

    def run(self, *arguments: str) -> str:
        """Run a module of the copy, such as `catenary`; return what it prints once it ended well."""
        environment = os.environ | {"PYTHONPATH": f"{self.src.parent}{os.pathsep}{self.tests}", "COLUMNS": "200"}
        ended = subprocess.run(
            [sys.executable, "-m", *arguments],
            cwd=self._folder, env=environment, capture_output=True, text=True, timeout=600.0, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout


@pytest.mark.slow
def test_a_controller_is_one_file_and_one_line(tmp_path: Path) -> None:
    walk = Walk("Add a controller", tmp_path)
    file, record = walk.code
    (walk.src / "control" / "saturated_pd.py").write_text(file)
    walk.add_line("control/controllers.py", "_KINDS = (", record)
    assert "saturated: PD of bounded error" in " ".join(walk.run("catenary", "track", "--help").split())
    told = json.loads(
        walk.run("catenary", "track", "raven2", "--controller", "saturated", "--motion", "poses", "--json")
    )
    assert (told["controller"], len(told["joints"])) == ("saturated", 3)
    walk.run("pytest", "tests/contracts/test_controllers.py", "-q", "-k", "saturated", "-p", "no:cacheprovider")
