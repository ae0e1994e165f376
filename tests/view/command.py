"""`catenary view` as a program of its own, and a model for it to show."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from catenary.calibration import calibration
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.workflows.simulated_recording import record_simulated
from oracles.cable_arms import homed_plant


@contextmanager
def view(*arguments: object) -> Iterator[str]:
    """Run it until the block ends; yields the address of its page."""
    command = [sys.executable, "-m", "catenary.cli.main", "view", *map(str, arguments), "--port", "18080"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        lines = []
        assert program.stdout is not None
        for line in program.stdout:
            lines.append(line)
            if found := re.search(r"http://127\.0\.0\.1:\d+/[\w-]+/", line):
                yield found[0]
                break
        else:
            raise AssertionError("".join(lines))
        for _ in range(3):  # as somebody presses Ctrl-C again, where a busy machine has not ended it
            program.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                program.wait(30.0)
                break
        assert program.poll() == 0
    finally:
        if program.poll() is None:
            program.kill()
            program.wait()


def model_of_positions(path: Path) -> Path:
    """Save a calibration model of the nominal simulated RAVEN-II, linear in its positions, of two minutes at random."""
    motion = random_sinusoids(np.random.default_rng(0), 120.0)
    log = record_simulated(homed_plant("left"), motion, "two minutes", np.random.default_rng(1))
    fitted = calibration.fit(log, model="linear", inputs=[f"q:{name}" for name in log.joint_names])
    fitted.save(path)
    return path
