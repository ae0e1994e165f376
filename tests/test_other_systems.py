"""What works on macOS and Windows without a robot, run with what these lack absent (`other_system.py`)."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import simulated_arm
from catenary.robots.catalog import load_robot
from command_line import catenary
from lab_tables import as_csv
from moving_arm import recorded, write_npz
from oracles.raven_recording import record, write_bag
from other_system import COMMANDS, REFUSED

MAPPING = """
[q_nominal]
columns = ["a", "b"]
units = ["deg", "mm"]
[q_encoder]
columns = ["cam_a", "cam_b"]
units = ["rad", "m"]
"""


def files(folder: Path) -> None:
    """Write what COMMANDS read; texts end their lines as Windows does."""
    simulated_arm.write(folder / "monday.npz", seed=1, rows=900)
    simulated_arm.write(folder / "tuesday.npz", seed=1, rows=600, noise=1.1e-4)
    for seed, name in enumerate(("run0", "run1", "loaded")):
        write_npz(recorded(load_robot("two_link"), seed, seconds=12.0, noise=0.01), folder / f"{name}.npz")
    t = np.arange(200) / 20.0
    a, b = np.sin(t), 0.1 + 0.05 * np.cos(t)
    as_csv(folder / "lab", {"t": t, "a": np.rad2deg(a), "b": 1e3 * b, "cam_a": a + 0.01, "cam_b": b})
    write_bag(record(folder / "run", 12.0), folder / "run.bag")
    whole = (folder / "run.bag").read_bytes()
    (folder / "run.bag").write_bytes(whole[: len(whole) // 2])
    texts = {
        "lab.csv": (folder / "lab.csv").read_text(),
        "lab.toml": MAPPING,
        "arm.toml": simulated_arm.DH_TABLE,
        "ur5e.urdf": (Path(__file__).parents[1] / "examples" / "ur5e.urdf").read_text(),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, newline="\r\n")


class Ended:
    """A system's outcomes by command, and the folder where they ran."""

    def __init__(self, system: str, folder: Path) -> None:
        self.folder = folder
        files(folder)
        ended = subprocess.run(
            [sys.executable, "-m", "other_system", system, str(folder)],
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
            capture_output=True, text=True, timeout=500.0, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        assert ended.returncode == 0, ended.stderr
        self.outcomes = json.loads((folder / "outcomes.json").read_text("utf-8"))


# Windows lacks all that macOS lacks
@pytest.fixture(scope="module", params=[pytest.param("darwin", marks=pytest.mark.slow), "win32"])
def ended(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Ended:
    return Ended(request.param, tmp_path_factory.mktemp(request.param))


def test_every_file_of_the_package_is_imported(ended: Ended) -> None:
    lacking = re.compile(r"ModuleNotFoundError: No module named '(rospy|rosgraph|genpy|rclpy|crtk_msgs)")
    assert {name: why for name, why in ended.outcomes["not imported"].items() if not lacking.match(why)} == {}


@pytest.mark.parametrize("name", COMMANDS)
def test_command_does_its_main_job(name: str, ended: Ended) -> None:
    code, out, err = ended.outcomes[name]
    assert code == 0, (out, err)
    written = re.search(r"--(?:out|c) (\S+)", COMMANDS[name])
    assert written is None or (ended.folder / written[1]).exists()


@pytest.mark.parametrize("name", REFUSED)
def test_what_needs_linux_says_so_in_one_sentence(name: str, ended: Ended) -> None:
    code, out, err = ended.outcomes[name]
    assert (code, out) == (2, "")
    assert re.fullmatch(r"catenary: [^:]+: Linux only; on this system [^:]+", err.splitlines()[-1])
    assert "Traceback" not in err
    assert not (ended.folder / "refused").exists()  # the project's folder


def test_a_step_that_was_done_is_not_done_again(ended: Ended) -> None:
    assert "every step is done already" in ended.outcomes["demo again"][1]
    steps = json.loads((ended.folder / "demo" / "steps.json").read_text("utf-8"))
    assert all("\\" not in path for step in steps.values() for path in (*step["files"], *step["outputs"]))


def test_every_name_that_was_written_is_one_on_all_systems(ended: Ended) -> None:
    """None that Windows refuses, none of a device, no two that differ by capitals alone: folders there do not tell."""
    names = [path.relative_to(ended.folder).as_posix() for path in ended.folder.rglob("*")]
    refused = r'[<>:"\\|?*\x00-\x1f]|[. ](/|$)|\.partial$|(?i:(^|/)(con|prn|aux|nul|com\d|lpt\d)(\.|/|$))'
    assert [name for name in names if re.search(refused, name)] == []
    assert 40 < len(names) == len({name.casefold() for name in names})


def test_numbers_are_those_of_this_system(ended: Ended, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a robot's table whose lines end as Windows ends them, by machine code that was made there."""
    monkeypatch.chdir(ended.folder)
    for name in ("gravity", "fk"):
        assert catenary(*COMMANDS[name].split()).out.splitlines() == ended.outcomes[name][1].splitlines()
