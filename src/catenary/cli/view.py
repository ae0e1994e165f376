"""catenary view: an arm in the browser, reported, calibrated and true; a simulated one is driven from there."""

import os
import sys
import time
import webbrowser
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import argument, option
from catenary.cli.recording_options import ModelRecordingOptions
from catenary.cli.robot_choice import (
    DIALECT,
    NAMESPACE,
    NODE_NAME,
    SIMULATED_SEED,
    MovedRobot,
    WatchedRobot,
    chosen_robot,
)
from catenary.cli.terminal import announce, print_json_line, print_notes
from catenary.errors import InputError


def view(
    recordings: ModelRecordingOptions,
    what: str | None = argument(
        "[ROBOT | PROJECT]",
        "raven2, another robot of the catalogue, a robot file, or the folder of a project. "
        "[default: raven2, or the robot that a recording names]",
        None,
    ),
    model: Path | None = option("MODEL", "Calibration model: also show the calibrated arm."),
    log: Path | None = option("LOG", "Show a recording; other formats with --map.", not_with=("ros", "robot_seed")),
    ros: int | None = option("1|2", "Watch a robot on ROS 1 or 2, read-only.", joins_ros=True),
    dialect: str | None = DIALECT,
    namespace: str | None = NAMESPACE,
    gravity: str | None = GRAVITY_TOPIC,
    name: str | None = replace(NODE_NAME, goes_with="ros"),
    control: bool = option(None, "With --ros: buttons that move the robot while held.", False, goes_with="ros"),
    simulated: bool = option(None, "With --control: simulated, no workspace.", False, goes_with="control"),
    yes: bool = option(None, "With --control: the workspace is clear; do not ask.", False, goes_with="control"),
    port: int = option(None, "Port on 127.0.0.1, or the next free one; from another machine use ssh -L.", 8080),
    browser: bool | None = option(None, "Open it in a browser. [default: on a screen]", flag="--open/--no-open"),
    robot_seed: int | None = replace(SIMULATED_SEED, not_with="ros"),
    seconds: float | None = option(None, "Duration. [default: until Ctrl-C]"),
    as_json: bool = option(None, "Print the address of the page as a line of JSON.", False, flag="--json"),
) -> None:
    """Show an arm in the browser.

    A simulated arm moves at once, and you drive it from the page: motion, controller, base, payload, sensor faults,
    friction and wear. The page shows the reported and the true arm, and with a model the calibrated one. A recording
    (--log, or a project's) is played, with a time line and a button to its largest error.

    Example: catenary view raven2
    """
    from catenary.view.page_process import PageProcess

    recorded = log is not None or (what is not None and _is_project(what))
    if recorded and (ros is not None or robot_seed is not None):
        raise InputError("--ros and --robot-seed are of a robot; --log and a project show a recording")
    if not recorded and recordings != ModelRecordingOptions():
        raise InputError("--as-is goes with --log or a project, as other options of recordings do")
    with ExitStack() as stack:
        page = stack.enter_context(PageProcess(port=port))
        end = float("inf") if seconds is None else time.monotonic() + seconds
        try:
            if recorded:
                announce(f"{page.url}: reading the recording ...")
                title, runs = _recording(what, log, model, recordings)
            elif ros is not None:
                asked = WatchedRobot(what or "raven2", ros, dialect, namespace, name, simulated)
                robot = MovedRobot(**vars(asked), yes=yes) if control else asked
                title, runs = _on_ros(stack, robot, model, gravity)
            else:
                announce(f"{page.url}: preparing the robot ...")
                title, runs = what or "raven2", _simulated(what or "raven2", model, robot_seed)
            url = page.open(runs.shown(f"catenary: {Path(title).name}"))
            if as_json:
                print_json_line({"shown": title, "url": url})
            else:
                print(f"{title}: {url} (Ctrl-C ends it)", flush=True)
            if _has_screen() if browser is None else browser:
                webbrowser.open(page.url)
            runs.run(page, lambda: time.monotonic() > end)
        except KeyboardInterrupt:
            pass  # the usual end


_Titled = tuple[str, Any]  # of the page; what has `shown` and `run`


def _simulated(robot: str, model: Path | None, seed: int | None) -> Any:
    import numpy as np

    from catenary.view.simulated import DrivenArm

    return DrivenArm(robot, model=model, seed=seed, rng=np.random.default_rng(0))


def _on_ros(stack: ExitStack, robot: WatchedRobot, model: Path | None, gravity: str | None) -> _Titled:
    """Return a robot on ROS, which is only read unless the options are those of one that is moved."""
    from catenary.view.controlled import ControlledArm
    from catenary.view.shapes import shapes_of
    from catenary.view.watched import WatchedArm

    moved = isinstance(robot, MovedRobot)
    opened = stack.enter_context(chosen_robot(robot, "view", moves=moved, gravity=gravity))
    arm = (ControlledArm if moved else WatchedArm)(opened, shapes_of(robot.robot, opened.model)[0], model)
    return robot.robot, arm


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
    title = str(what if what is not None and log is None else path)
    return title, Replay(recorded_arm(recording, arm, loaded), shapes_of(named, arm)[0])


def _is_project(what: str) -> bool:
    if not Path(what).is_dir():  # what reads projects takes a second to import
        return False
    from catenary.workflows.project.folder import is_project

    return is_project(Path(what))


def _has_screen() -> bool:
    """Return whether somebody sits at a terminal of a machine that can show a window."""
    windows = sys.platform == "darwin" or any(os.environ.get(n) for n in ("DISPLAY", "WAYLAND_DISPLAY"))
    return windows and sys.stdout.isatty()
