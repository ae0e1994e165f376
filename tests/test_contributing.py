"""The walks of CONTRIBUTING.md, each done as it is written on a copy of the package."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from shutil import copytree, ignore_patterns
from textwrap import dedent

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot
from moving_arm import LEVEL, recorded, sinusoids, write_npz

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


class Walk:
    """A section of CONTRIBUTING.md, and a copy of the package and its tests to follow it on."""

    def __init__(self, title: str, folder: Path) -> None:
        text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
        section = text.partition(f"### {title}")[2].partition("\n### ")[0]
        blocks = re.findall(r"^ *```(?:python|markdown)\n(.*?)^ *```", section, flags=re.MULTILINE | re.DOTALL)
        self.code = [dedent(block) for block in blocks]
        self.folder, self.src = folder, folder / "src" / "catenary"
        for kept in ("src", "docs", "tests"):
            copytree(ROOT / kept, folder / kept, ignore=ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "README.md"):
            (folder / name).write_bytes((ROOT / name).read_bytes())

    def add(self, file: str, after: str, text: str) -> None:
        """Write text below the line that begins so."""
        path = self.folder / file
        content, found = re.subn(
            f"^{re.escape(after)}.*\n", lambda at: at[0] + text, path.read_text("utf-8"), flags=re.MULTILINE
        )
        assert found == 1
        path.write_text(content, "utf-8")

    def run(self, *arguments: str, codes: tuple[int, ...] = (0,)) -> str:
        """Run a module of the copy, such as `catenary`; return what it prints once it ended so."""
        environment = os.environ | {"PYTHONPATH": f"{self.src.parent}{os.pathsep}{self.folder / 'tests'}"}
        ended = subprocess.run(
            [sys.executable, "-m", *arguments],
            cwd=self.folder, env=environment | {"COLUMNS": "200"}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert ended.returncode in codes, ended.stdout + ended.stderr
        return ended.stdout

    def test(self, file: str, kind: str) -> None:
        """Run the contract tests of a kind."""
        self.run("pytest", f"tests/contracts/{file}", "-q", "-k", kind, "-p", "no:cacheprovider")


def test_a_controller_is_one_file_and_one_line(tmp_path: Path) -> None:
    walk = Walk("Add a controller", tmp_path)
    file, record = walk.code
    (walk.src / "control" / "saturated_pd.py").write_text(file)
    walk.add("src/catenary/control/controllers.py", "_KINDS = (", f"{record.strip()},\n")
    assert "saturated: PD of bounded error" in " ".join(walk.run("catenary", "track", "--help").split())
    track = ["catenary", "track", "raven2", "--controller", "saturated", "--motion", "poses", "--json"]
    told = json.loads(walk.run(*track))
    assert (told["controller"], len(told["joints"])) == ("saturated", 3)
    walk.test("test_controllers.py", "saturated")


def test_a_file_format_is_a_reader_and_a_record(tmp_path: Path) -> None:
    walk = Walk("Add a file format", tmp_path)
    reader, record = walk.code
    (walk.src / "recording" / "import_formats" / "json_lines.py").write_text(reader)
    walk.add("src/catenary/file_formats.py", "FORMATS = (", f"{record.strip()},\n")
    t = np.arange(0.0, 20.0, 0.01)
    q = np.column_stack([np.sin(t), np.cos(1.3 * t)])
    rows = [json.dumps({"t": at, "q1": one, "q2": two}) for at, one, two in np.column_stack([t, q]).tolist()]
    (tmp_path / "lab.jsonl").write_text("\n".join(rows))
    how = ["--map", "q_nominal=q1,q2", "--units", "rad"]
    walk.run("catenary", "import", "lab.jsonl", *how, "--out", "lab.parquet")
    walk.run("catenary", "check", "lab.jsonl", *how, codes=(0, 1))  # 1: it misses an encoder
    assert_array_equal(read_log(tmp_path / "lab.parquet").q_nominal, q)
    with pytest.raises(AssertionError, match="JSON lines"):  # until it has an example
        walk.run("pytest", "tests/contracts/test_file_formats.py", "-q", "-x", "-p", "no:cacheprovider")


def test_a_friction_term_is_added_by_its_record_alone(tmp_path: Path) -> None:
    walk = Walk("Add a friction term", tmp_path)
    record, row = walk.code
    terms = walk.src / "robots" / "friction_terms.py"
    before, end, after = terms.read_text().partition(")  # fmt: skip\nFRICTION_TERMS")
    terms.write_text(f"{before}{record.strip()},\n{end}{after}")
    walk.add("docs/identification.md", "| `presliding` |", row)
    walk.test("test_friction_terms.py", "quadratic")
    arm = load_robot("raven2")
    q, qd, qdd = sinusoids(np.random.default_rng(0), arm, np.arange(6000) / 200.0)
    noise = 0.01 * np.random.default_rng(1).normal(size=q.shape)
    tau = inverse_dynamics(arm, q, qd, qdd, LEVEL) + 0.3 * qd + 0.2 * qd * np.abs(qd) + noise
    write_npz(recorded(arm, 0, tau=tau), tmp_path / "drag.npz")
    assert "quadratic" in walk.run("catenary", "identify", "--help")
    identify = ["catenary", "identify", "drag.npz", "--robot", "raven2", "--out", "arm.npz", "--json"]
    assert "quadratic" in {part["kind"] for part in json.loads(walk.run(*identify))["friction"]}
