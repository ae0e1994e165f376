"""catenary monitor: what a robot does, on a screen; or a recording, played."""

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.gravity_options import GRAVITY_TOPIC
from catenary.cli.options import option
from catenary.cli.recording_options import ModelRecordingOptions
from catenary.cli.robot_choice import WatchedRobot, chosen_robot
from catenary.cli.terminal import announce, print_json_line, print_notes
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.monitor import Snapshot
    from catenary.teleop.terminal import RawTerminal


_LIVE = ("ros", "base_tilt_deg", "robot_seed")  # options of a robot that is watched


def monitor(
    robot: WatchedRobot,
    recordings: ModelRecordingOptions,
    log: Path | None = option("FILE", "Play a recording: .parquet, .npz or .csv; others with --map.", not_with=_LIVE),
    model: Path | None = option("MODEL", "Calibration model: calibrated joints, valid range."),
    speed: float = option(None, "With --log: factor on its own speed.", 1.0, goes_with="log"),
    rate: float | None = option("HZ", "Samples a second. [default: 25 on a screen, 1 in a pipe]"),
    seconds: float | None = option(None, "How long to watch. [default: until Q or Ctrl-C]"),
    gravity: str | None = GRAVITY_TOPIC,
    as_json: bool = option(None, "Print a line of JSON for each sample, SI.", False, flag="--json"),
) -> None:
    """Show what a robot or a recording does.

    Joints, setpoints, torques, gravity, state, warnings; a robot is only read. In a terminal a screen that
    is drawn 25 times a second; in a pipe a line a second. Of a robot simulated here it also shows how far joints
    and tip really are from what is reported.

    Example: catenary monitor --log demo/test.parquet --model demo/models/neural_best.npz
    """
    from catenary.monitor import plain_line
    from catenary.teleop.terminal import RawTerminal

    on_screen = sys.stdout.isatty() and sys.stdin.isatty() and not as_json
    hertz = rate if rate is not None else 25.0 if on_screen else 1.0
    if not 0.0 < hertz <= 200.0:
        raise InputError(f"--rate: expected more than 0 and at most 200 Hz, got {hertz}")
    with ExitStack() as stack:
        if log is not None:
            from catenary.calibration.model_file import load_model
            from catenary.workflows.calibration_model import recording_for
            from catenary.workflows.robot.snapshots import watch_log

            loaded = None if model is None else load_model(model)[0]
            played = recording_for(loaded, log, recordings.reading())
            print_notes([note for note in played.notes if note.startswith("corrected")])
            name, samples = log.name, watch_log(played, model=loaded, every=1.0 / hertz, speed=speed)
        else:
            from catenary.workflows.robot.snapshots import watch_robot

            announce("preparing the robot ...")
            opened = stack.enter_context(chosen_robot(robot, "monitor", moves=False, gravity=gravity))
            name, samples = opened.name, watch_robot(opened, model=model, every=1.0 / hertz)
        try:
            if on_screen:
                _on_screen(name, _until(samples, seconds), stack.enter_context(RawTerminal()))
                return
            for sample in _until(samples, seconds):
                if as_json:
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
    import os

    from catenary.monitor import monitor_lines

    colour = "NO_COLOR" not in os.environ
    for sample in samples:
        if terminal.wants_suspension:
            terminal.suspend()
        terminal.draw(monitor_lines(name, sample, *terminal.size, colour=colour))
        if terminal.ended is not None or b"q" in terminal.read().lower():
            return
    while terminal.ended is None and b"q" not in terminal.read().lower():
        time.sleep(0.05)  # the end of a recording stays on the screen
