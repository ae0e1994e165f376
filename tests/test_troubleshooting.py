"""The page of messages: every error class is on it, and what it quotes is what is printed."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from catenary import errors
from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.plant import OperatingState, require_ready
from catenary.workflows.project.folder import FolderLock
from command_line import catenary, in_its_own_process

PAGE = (Path(__file__).parents[1] / "docs" / "troubleshooting.md").read_text()
# command and what is quoted of its output
QUOTED = re.findall(r"^```text\n\$ catenary (.*)\n((?:(?!```).*\n)+)```", PAGE, re.MULTILINE)
# they simulate or fit first, which takes seconds
SLOW = ("evaluate arm.npz far", "evaluate arm.npz good")
MODEL_NEEDED = ("evaluate arm.npz", "payload")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the quoted commands name."""
    path = tmp_path_factory.mktemp("messages")
    t = np.linspace(0.0, 60.0, 1800)
    q = np.column_stack([np.sin(t), 0.5 * np.cos(1.7 * t), 0.1 + 0.05 * np.sin(0.5 * t)])
    seen = q + np.column_stack([0.02 * q[:, 1], 0.03 * q[:, 0], 0.001 * q[:, 0]])

    def write(name: str, q_des: np.ndarray, q_act: np.ndarray) -> None:
        rows = len(q_des)
        np.savez(path / name, q_des=q_des, q_act=q_act, ok=np.ones(rows, dtype=bool), t=t[:rows])

    write("good.npz", q, seen)
    write("far.npz", 6.0 * q, 6.0 * seen)
    write("degrees.npz", np.rad2deg(q), np.rad2deg(seen))
    (path / "notes.csv").write_text("hello\nworld\n")
    (path / "arm.toml").write_text('name = "a"\nconvention = "modified"\nsource = ["x"]\n')
    ends = '<parent link="base"/><child link="rod"/>'
    links = '<link name="base"/><link name="rod"/>'
    floating = f'<robot name="f">{links}<joint name="j" type="floating">{ends}</joint></robot>'
    swing = f'<joint name="j" type="continuous">{ends}<axis xyz="0 1 0"/></joint>'
    (path / "floating.urdf").write_text(floating)
    (path / "no_mass.urdf").write_text(f'<robot name="no_mass">{links}{swing}</robot>')
    return path


def _line_pattern(line: str) -> str:
    """Return what a quoted line stands for: numbers and their signs may differ, three dots are anything."""
    numbers = re.sub(r"(\\-)?\d+(\\\.\d+)?", r"-?[\\d.]+", re.escape(line))
    return numbers.replace(r"\.\.\.", ".*")


@pytest.mark.parametrize(
    ("command", "quoted"),
    [pytest.param(*one, id=one[0], marks=[pytest.mark.slow] if one[0].startswith(SLOW) else []) for one in QUOTED],
)
def test_a_quoted_message_is_what_the_command_prints(
    command: str, quoted: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:11999")  # where nobody listens
    run = catenary
    if "--ros 1" in command:
        try:
            make_rospy_importable()
        except errors.MissingPackageError as error:
            pytest.skip(str(error))
        run = in_its_own_process  # a process is one node until it ends, and other tests may have made this one another
    if command.startswith(MODEL_NEEDED) and not Path("arm.npz").exists():
        assert catenary("fit", "good.npz", "--model", "linear", "--out", "arm.npz").code == 0
    printed = run(*command.split())
    assert printed.code in (0, 2)
    for line in quoted.splitlines():
        assert re.search(f"^{_line_pattern(line)}", printed.err, re.MULTILINE), (line, printed.err)


def test_every_error_class_is_on_the_page() -> None:
    classes = {name for name, one in inspect.getmembers(errors, inspect.isclass) if issubclass(one, Exception)}
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)) == classes
    assert len(classes) > 15
    assert len(QUOTED) >= 15


class Robot:
    """A robot in one operating state."""

    supports = frozenset({"servo_jp"})

    def __init__(self, state: OperatingState) -> None:
        self.operating_state = lambda: state


@pytest.mark.parametrize(
    "state", [OperatingState("ENABLED", False, False), OperatingState("PAUSED", True, False)], ids=str
)
def test_what_a_robot_that_is_not_ready_says_is_on_the_page(state: OperatingState) -> None:
    with pytest.raises(errors.NotReadyError) as refused:
        require_ready(Robot(state), "servo_jp")  # type: ignore[arg-type]
    assert f"`{refused.value}`" in PAGE


def test_what_a_second_command_in_a_project_says_is_on_the_page(tmp_path: Path) -> None:
    FolderLock(tmp_path).take()
    with pytest.raises(errors.InUseError, match=r"has been writing in it since .*; wait until it ends"):
        FolderLock(tmp_path).take()
    assert "has been writing in it since TIME; wait until it ends" in " ".join(PAGE.split())
