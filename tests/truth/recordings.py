"""Recordings whose truth is known: of simulated arms, and real ones that are spoilt on top; see `spoilings`."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import CablePlant, MotionLog, random_sinusoids, record_simulated, zigzag
from catenary.recording.logs import read_log
from catenary.simulation.psm_plant import PsmPlant, psm_telemetry
from catenary.workflows.simulated_recording import driven

ROOT = Path(__file__).parents[2]
START = (0.5, 1.5, 0.40)  # where a RAVEN-II wakes up [rad, rad, m]
# a PSM's box, bands in which joints turn, and speeds [rad, rad, m, rad, rad, rad]
PSM_UPPER = np.array([0.6, 0.45, 0.20, 1.2, 1.0, 1.0])
PSM_LOWER = np.array([-0.6, -0.45, 0.08, -1.2, -1.0, -1.0])
PSM_SLOW, PSM_FAST = 0.04 * (PSM_UPPER - PSM_LOWER), 0.25 * (PSM_UPPER - PSM_LOWER)
PSM_TICKS = 33  # between rows [ms]
TOOL_FOLDERS = ("4LRoll1", "4LPitch2", "5L2")


class Known(NamedTuple):
    """Recordings of one arm, unspoilt, and what it did another time."""

    name: str
    logs: tuple[MotionLog, ...]
    again: tuple[MotionLog, ...]  # what a claim is about: unspoilt, every row; the same recordings of a real arm
    robot: str | None = None


def data_folder() -> Path:
    """Return the folder of real recordings, which may be absent."""
    return Path(os.environ.get("CATENARY_DATA", ROOT.parent / "shared" / "data"))


@cache
def raven(motion: str, seed: int = 3) -> Known:
    """Return a simulated RAVEN-II along zig-zags ("zigzag"), or each joint at random ("random"), 5 minutes or so.

    What comes after is random: zig-zags are driven to be learnt from, and the same ones again would be no test.
    """
    plant = CablePlant(seed=seed, start=START, substeps=1)
    plant.home()
    logs = []
    for drive in range(2):
        rng = np.random.default_rng([seed, drive])
        way = zigzag("J2-J3", (1 / 3,)) if motion == "zigzag" and drive == 0 else random_sinusoids(rng, 300.0)
        logs.append(replace(record_simulated(plant, way, f"{motion}-{seed}-{drive}", rng), signals={}, signal_units={}))
    return Known(f"simulated RAVEN-II, {motion}", (logs[0],), (logs[1],))


@cache
def psm(seed: int = 4) -> Known:
    """Return a simulated PSM whose six joints move at random, 5 minutes at 30 Hz, seen by a tracker."""
    plant = PsmPlant(seed=seed)
    plant.home()
    logs = []
    for drive in range(2):
        way = random_sinusoids(
            np.random.default_rng([seed, drive]), 300.0, lower=PSM_LOWER, upper=PSM_UPPER,
            turning_band=0.2 * (PSM_UPPER - PSM_LOWER), slowest=PSM_SLOW, fastest=PSM_FAST,
        )  # fmt: skip
        here = plant.control.setpoint.copy()
        rows = np.tile(here, (4000, 1))
        rows[:, :6] += (way(0.0).q - here[:6]) * (0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 4000)))[:, None]
        plant.run(rows)
        parts = [psm_telemetry(plant, log) for log, _ in driven(plant, way, 20_000)]
        told = {name: np.concatenate([part[name] for part in parts])[::PSM_TICKS] for name in parts[0]}
        count = len(told["measured_js"])
        logs.append(
            MotionLog(
                f"psm-{drive}", plant.joint_names[:6], plant.joint_units[:6], told["measured_js"],
                np.ones(count, dtype=bool), told["ext_jpos"], time=np.arange(count) * PSM_TICKS * 1e-3,
                robot="dvrk_psm", simulated=True,
            )
        )  # fmt: skip
    return Known("simulated PSM", (logs[0],), (logs[1],))


@cache
def dvrk(name: str) -> Known:
    """Return a real dVRK's PSM, whose joints a camera measured (Hwang et al.); rows are .4 s apart."""
    log = read_log(data_folder() / "dvrk_calibration_berkeley" / f"{name}.npz")
    return Known(f"real dVRK, {name}", (log,), (log,), "dvrk_psm")


@cache
def tool(folder: str) -> Known:
    """Return a real da Vinci tool on a bench, four runs of a sine against a load at 100 Hz (Stephens et al.)."""
    paths = sorted((data_folder() / "davinci_tools").glob(f"{folder}_*.npz"))[:4]
    logs = tuple(read_log(path) for path in paths)
    return Known(f"real da Vinci tool, {folder}", logs, logs)


def simulated() -> Iterator[Callable[[], Known]]:
    """Yield the makers of simulated recordings."""
    yield from (lambda: raven("zigzag"), lambda: raven("random"), psm)


def real() -> Iterator[Callable[[], Known]]:
    """Yield the makers of real ones; none where they are absent."""
    if data_folder().is_dir():
        for name in ("random_train", "peg_transfer_train"):
            yield lambda name=name: dvrk(name)  # type: ignore[misc]
        for folder in TOOL_FOLDERS:
            yield lambda folder=folder: tool(folder)  # type: ignore[misc]
