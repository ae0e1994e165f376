"""catenary view: an arm in the browser, reported, calibrated and true; a simulated one is driven from there."""

import os
import sys
import time
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING, NamedTuple, Protocol

from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import argument, option, robots_beginning
from catenary.cli.recording_options import ModelRecordingOptions
from catenary.cli.robot_choice import DIALECT, NAMESPACE, NODE_NAME, MovedRobot, WatchedRobot, chosen_robot
from catenary.cli.terminal import announce, print_json_line, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.view.page_process import PageProcess
    from catenary.view.shown import Shown

HERE = "127.0.0.1"


def view(
    recordings: ModelRecordingOptions,
    what: str | None = argument(
        "[ROBOT | PROJECT]",
        "raven2, another robot of the catalogue, a robot file, or the folder of a project. "
        "[default: raven2, or the robot that a recording names]",
        None,
        completes=robots_beginning,
    ),
    model: Path | None = option("MODEL", "Calibration model: also show the calibrated arm."),
    log: Path | None = option(
        "LOG", "Show a recording of the robot: .parquet, .npz, or others with --map.", not_with=("ros", "robot_seed")
    ),
    ros: int | None = option("1|2", "Watch a robot on ROS 1 or 2, read-only.", choices=(1, 2), joins_ros=True),
    dialect: str | None = DIALECT,
    namespace: str | None = NAMESPACE,
    gravity: str | None = GRAVITY_TOPIC,
    name: str | None = replace(NODE_NAME, goes_with="ros"),
    control: bool = option(
        None, "With --ros: buttons that move the robot while they are held, as teleop does.", False, goes_with="ros"
    ),
    simulated: bool = option(
        None, "With --control: that robot is simulated, there is no workspace to clear.", False, goes_with="control"
    ),
    yes: bool = option(None, "With --control: the workspace is clear; do not ask.", False, goes_with="control"),
    port: int = option(None, "Of 127.0.0.1; the next free one where it is taken.", 8080),
    host: str = option(None, "127.0.0.1 alone; from another machine forward the port over SSH.", HERE),
    browser: bool | None = option(
        None,
        "Open the page in this machine's browser. [default: from a terminal on a screen]",
        flag="--open/--no-open",
        shows_default=False,
    ),
    robot_seed: int | None = option(
        None, "Another RAVEN-II, drawn with this seed. [default: the nominal one]", not_with="ros"
    ),
    seconds: float | None = option(None, "How long. [default: until Ctrl-C]"),
    as_json: bool = option(None, "Print the address of the page as a line of JSON.", False, flag="--json"),
) -> None:
    """Show an arm in the browser.

    A simulated arm moves at once, and is driven from the page: motion, controller, base, payload, sensor's faults,
    friction and wear. Beside the reported arm stands the true one, and with a model the calibrated one. A recording
    (--log, or that of a project) is played, with a time line and the way to its largest error.

    Example: catenary view raven2
    """
    from catenary.view.page_process import PageProcess

    if host != HERE:
        raise InputError(_elsewhere(host, port))
    recorded = log is not None or (what is not None and _is_project(what))
    if recorded and (ros is not None or robot_seed is not None):
        raise InputError("--ros and --robot-seed are of a robot; --log and a project show a recording")
    if not recorded and recordings != ModelRecordingOptions():
        raise InputError("--no-mend goes with --log or a project, as all that mends a recording")
    with ExitStack() as stack:
        page = stack.enter_context(PageProcess(port=port))
        end = float("inf") if seconds is None else time.monotonic() + seconds
        try:
            if recorded:
                announce(f"{page.url}: reading the recording ...")
                shown = _recording(what, log, model, recordings)
            elif ros is not None:
                asked = WatchedRobot(what or "raven2", ros, dialect, namespace, name, simulated)
                robot = MovedRobot(**vars(asked), yes=yes) if control else asked
                shown = _beside(stack, robot, model, gravity)
            else:
                announce(f"{page.url}: preparing the robot ...")
                shown = _simulated(what or "raven2", model, robot_seed)
            _open(page, shown.title, shown.runs.shown(f"catenary: {Path(shown.title).name}"), as_json=as_json)
            if _has_screen() if browser is None else browser:
                webbrowser.open(page.url)
            shown.runs.run(page, lambda: time.monotonic() > end)
        except KeyboardInterrupt:
            pass  # the usual end


class _Runs(Protocol):
    """Something that is shown for as long as it runs."""

    def shown(self, title: str) -> "Shown": ...

    def run(self, page: "PageProcess", ended: Callable[[], bool]) -> None: ...


class _Titled(NamedTuple):
    title: str
    runs: _Runs


def _simulated(robot: str, model: Path | None, seed: int | None) -> _Titled:
    import numpy as np

    from catenary.view.simulated import DrivenArm

    return _Titled(robot, DrivenArm(robot, model=model, seed=seed, rng=np.random.default_rng(0)))


def _beside(stack: ExitStack, robot: WatchedRobot, model: Path | None, gravity: str | None) -> _Titled:
    """Return a robot on ROS, which is only read unless the options are those of one that is moved."""
    from catenary.view.controlled import ControlledArm
    from catenary.view.shapes import shapes_of
    from catenary.view.watched import WatchedArm

    moved = isinstance(robot, MovedRobot)
    opened = stack.enter_context(chosen_robot(robot, "view", moves=moved, gravity=gravity))
    arm = (ControlledArm if moved else WatchedArm)(opened, shapes_of(robot.robot, opened.model)[0], model)
    return _Titled(robot.robot, arm)


def _recording(what: str | None, log: Path | None, model: Path | None, recordings: ModelRecordingOptions) -> _Titled:
    """Return a recording of a robot, or a project's."""
    from catenary.calibration.model_file import load_model
    from catenary.robots.catalog import load_robot
    from catenary.view.replay import Replay, recorded_arm, shown_project
    from catenary.view.shapes import shapes_of
    from catenary.workflows.calibration_model import recording_for

    robot, path = what, log or Path()
    if what is not None and _is_project(what):
        project = shown_project(Path(what))
        robot, path, model = project.robot, log or project.log, model or project.model
    loaded = None if model is None else load_model(model)[0]
    recording = recording_for(loaded, path, recordings.reading())
    print_notes([note for note in recording.notes if note.startswith("corrected")])
    named = robot or recording.robot or "raven2"
    arm = load_robot(named)
    return _Titled(
        str(what if what is not None and log is None else path),
        Replay(recorded_arm(recording, arm, loaded), shapes_of(named, arm)[0]),
    )


def _is_project(what: str) -> bool:
    if not Path(what).is_dir():  # what reads projects takes a second to import
        return False
    from catenary.workflows.project.folder import is_project

    return is_project(Path(what))


def _open(page: "PageProcess", what: str, shown: "Shown", *, as_json: bool) -> None:
    """Open the page and say where it is."""
    url = page.open(shown)
    if as_json:
        print_json_line({"shown": what, "url": url})
    else:
        print(f"{what}: {url} (Ctrl-C ends it)", flush=True)


def _has_screen() -> bool:
    """Return whether somebody sits at a terminal of a machine that can show a window."""
    windows = sys.platform == "darwin" or any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY"))
    return windows and sys.stdout.isatty()


def _elsewhere(host: str, port: int) -> str:
    return (
        f'--host "{host}": expected {HERE}: whoever knows the address of the page can drive the arm. From another '
        f"machine: ssh -L {port}:{HERE}:{port} {gethostname()}, then open there the address that this one prints"
    )
