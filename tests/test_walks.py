"""The walks of CONTRIBUTING.md, taken as written on a copy of the package."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.robots.catalog import load_robot
from documented import ROOT
from moving_arm import LEVEL, recorded, sinusoids, write_npz


def told_blocks(heading: str) -> list[str]:
    """Return the code of a walk, in order."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    walk = text.partition(f"### {heading}")[2].partition("\n### ")[0]
    return [dedent(block) for block in re.findall(r"^ *```\w+\n(.*?)^ *```$", walk, re.MULTILINE | re.DOTALL)]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package, its pages and what contract suites import."""
    for folder in ("src", "docs", "tests/contracts"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for path in (ROOT / "pyproject.toml", ROOT / "README.md", *(ROOT / "tests").glob("*.py")):
        shutil.copy2(path, tmp_path / path.relative_to(ROOT))
    return tmp_path


def run(package: Path, *words: str | Path) -> str:
    """Return what a command of the copy prints."""
    environment = os.environ | {"PYTHONPATH": str(package / "src")}
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=package, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def insert(path: Path, before: str, text: str) -> None:
    """Write text before the first place of another."""
    content = path.read_text(encoding="utf-8")
    assert before in content
    path.write_text(content.replace(before, text + before, 1), encoding="utf-8")


@pytest.mark.slow
def test_a_friction_term_is_added_by_its_record_alone(package: Path) -> None:
    record, row = told_blocks("Add a friction term")
    insert(package / "src/catenary/robots/friction_terms.py", ")  # fmt: skip\nFRICTION_TERMS", record)
    insert(package / "docs/identification.md", "| `recording` |", row)
    run(package, "pytest", "-q", "-p", "no:cacheprovider", "tests/contracts/test_friction_terms.py", "-k", "quadratic")
    arm = load_robot("raven2")
    q, qd, qdd = sinusoids(np.random.default_rng(0), arm, np.arange(6000) / 200.0)
    noise = 0.01 * np.random.default_rng(1).normal(size=q.shape)
    tau = inverse_dynamics(arm, q, qd, qdd, LEVEL) + 0.3 * qd + 0.2 * qd * np.abs(qd) + noise
    write_npz(recorded(arm, 0, tau=tau), package / "drag.npz")
    assert "quadratic" in run(package, "catenary", "identify", "--help")
    told = json.loads(
        run(package, "catenary", "identify", "drag.npz", "--robot", "raven2", "--out", "arm.npz", "--json")
    )
    assert "quadratic" in {part["kind"] for part in told["friction"]}
