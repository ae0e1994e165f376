"""catenary monitor, view: what a robot does, in a terminal; it or a recording, in a browser; there it may be driven."""

import os
import sys
import time
import webbrowser
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import catenary
from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import argument, json_help, option
from catenary.cli.recording_options import OWN_CLASS, ModelRecordingOptions, calibration_of
from catenary.cli.robot_options import RobotPlace, WatchedRobot, chosen_robot
from catenary.cli.terminal import announce, print_json_line, print_notes, prints_json
from catenary.errors import InputError
from catenary.operating_system import HAS_SINGLE_KEYS, has_windows
from catenary.teleop.terminal import RawTerminal

if TYPE_CHECKING:
    from catenary.monitor import Snapshot


@json_help("Print the address of the page as a line of JSON.")
def view(
    recordings: ModelRecordingOptions,
    place: RobotPlace,
    what: str | None = argument(
        "[ROBOT | PROJECT]",
        "raven2, another robot of the catalogue, a robot file, or the folder of a project. "
        "[default: raven2, or the robot that a recording names]",
        None,
    ),
    model: Path | None = option("MODEL", "Calibration model: also show the calibrated arm."),
    own: str | None = replace(OWN_CLASS, goes_with="model"),
    log: Path | None = option("LOG", "Show a recording; other formats with --map.", not_with=("ros", "robot_seed")),
    gravity: str | None = GRAVITY_TOPIC,
    port: int = option(None, "Port on 127.0.0.1, or the next free one; from another machine use ssh -L.", 8080),
    browser: bool | None = option(None, "Open it in a browser. [default: on a screen]", flag="--open/--no-open"),
    seconds: float | None = option(None, "Duration. [default: until Ctrl-C]"),
) -> None:
    """Show an arm in the browser.

    A simulated arm moves at once, and you drive it from the page: motion, controller, base, payload, sensor faults,
    friction and wear. The page shows the reported and the true arm, and with a model the calibrated one. A recording
    (--log, or a project's) is played, with a time line and a button to its largest error.

    Example: catenary view raven2
    """
    from catenary.view.page_process import PageProcess

    recorded = log is not None or (what is not None and _is_project(what))
    if recorded and (place.ros is not None or place.robot_seed is not None):
        raise InputError("--ros and --robot-seed are of a robot; --log and a project show a recording")
    if not recorded and recordings != ModelRecordingOptions():
        raise InputError("--as-is goes with --log or a project, as other options of recordings do")
    with ExitStack() as stack:
        page = stack.enter_context(PageProcess(port=port))
        end = float("inf") if seconds is None else time.monotonic() + seconds
        try:
            if recorded:
                announce(f"{page.url}: reading the recording ...")
                title, runs = _recording(what, log, model, own, recordings)
            elif place.ros is not None:
                from catenary.view.meshes import shapes_of
                from catenary.view.replay import WatchedArm

                robot = WatchedRobot(**{**vars(place), "robot": what or "raven2"})
                opened = stack.enter_context(chosen_robot(robot, "view", moves=False, gravity=gravity))
                shapes, _ = shapes_of(robot.robot, opened.model)
                title, runs = robot.robot, WatchedArm(opened, shapes, calibration_of(model, own))
            else:
                announce(f"{page.url}: preparing the robot ...")
                import numpy as np

                from catenary.view.simulated_arm import DrivenArm

                title, rng = what or "raven2", np.random.default_rng(0)
                runs = DrivenArm(title, model=calibration_of(model, own), seed=place.robot_seed, rng=rng)
            url = page.open(runs.shown(f"catenary: {Path(title).name}"))
            if prints_json():
                print_json_line({"shown": title, "url": url})
            else:
                print(f"{title}: {url} (Ctrl-C ends it)", flush=True)
            # somebody may sit at a terminal of a machine that can show a window
            if has_windows() and sys.stdout.isatty() if browser is None else browser:
                webbrowser.open(page.url)
            runs.run(page, lambda: time.monotonic() > end)
        except KeyboardInterrupt:
            pass  # the usual end


def _recording(
    what: str | None, log: Path | None, model: Path | None, own: str | None, recordings: ModelRecordingOptions
) -> tuple[str, Any]:
    """Return the title and player of a recording, or a project's, corrected as the model's training data, if any."""
    from catenary.view.meshes import shapes_of
    from catenary.view.replay import Replay, recorded_arm, shown_project
    from catenary.workflows.calibration_model import recording_for

    robot, path = what, log or Path()
    if what is not None and _is_project(what):
        recorded, recommended, robot = shown_project(Path(what))
        path, model = log or recorded, model or recommended
    loaded = calibration_of(model, own)
    recording = recording_for(loaded, path, recordings.reading())
    print_notes([note for note in recording.notes if note.startswith("corrected")])
    named = robot or recording.robot or "raven2"
    arm = catenary.load_robot(named)
    title = str(what if what is not None and log is None else path)
    return title, Replay(recorded_arm(recording, arm, loaded), shapes_of(named, arm)[0])


def _is_project(what: str) -> bool:
    if not Path(what).is_dir():  # what reads projects takes a second to import
        return False
    from catenary.workflows.project.folder import is_project

    return is_project(Path(what))


@json_help("Print a line of JSON for each sample, SI.")
def monitor(
    robot: WatchedRobot,
    model: Path | None = option("MODEL", "Calibration model: calibrated joints, valid range."),
    own: str | None = replace(OWN_CLASS, goes_with="model"),
    rate: float | None = option("HZ", "Samples a second. [default: 25 on a screen, 1 in a pipe]"),
    seconds: float | None = option(None, "How long to watch. [default: until Q or Ctrl-C]"),
    gravity: str | None = GRAVITY_TOPIC,
) -> None:
    """Show the state of a robot.

    Joints, setpoints, torques, gravity, state, warnings; it only reads the robot. In a terminal the screen
    is updated 25 times a second; a pipe gets a line a second. For a robot simulated here it also shows the errors of
    the reported joints and tip. `catenary view --log` plays a recording.

    Example: catenary monitor --model demo/models/recommended.npz
    """
    from catenary.monitor import plain_line
    from catenary.workflows.robot.snapshots import watch_robot

    on_screen = HAS_SINGLE_KEYS and sys.stdout.isatty() and sys.stdin.isatty() and not prints_json()
    hertz = rate if rate is not None else 25.0 if on_screen else 1.0
    if not 0.0 < hertz <= 200.0:
        raise InputError(f"--rate: expected more than 0 and at most 200 Hz, got {hertz}")
    with ExitStack() as stack:
        announce("preparing the robot ...")
        opened = stack.enter_context(chosen_robot(robot, "monitor", moves=False, gravity=gravity))
        name, samples = opened.name, watch_robot(opened, model=calibration_of(model, own), every=1.0 / hertz)
        try:
            if on_screen:
                _on_screen(name, _until(samples, seconds), stack.enter_context(RawTerminal()))
                return
            for sample in _until(samples, seconds):
                if prints_json():
                    print_json_line(sample.as_data())
                else:
                    print(plain_line(sample), flush=True)
        except KeyboardInterrupt:
            pass  # the usual end


def _until(samples: "Iterator[Snapshot]", seconds: float | None) -> "Iterator[Snapshot]":
    """Yield samples for so long after the first: what it takes to prepare is not watched."""
    end = None
    for sample in samples:
        end = time.monotonic() + (float("inf") if seconds is None else seconds) if end is None else end
        yield sample
        if time.monotonic() >= end:
            return


def _on_screen(name: str, samples: "Iterator[Snapshot]", terminal: "RawTerminal") -> None:

    from catenary.monitor import monitor_lines

    colour = "NO_COLOR" not in os.environ
    for sample in samples:
        if terminal.wants_suspension:
            terminal.suspend()
        terminal.draw(monitor_lines(name, sample, *terminal.size, colour=colour))
        if terminal.ended is not None or b"q" in terminal.read().lower():
            return
