"""What the frozen plant does where it was not fitted: other directions, a payload, six hours, homing again.

Run it with `make plant-check`; it prints the tables of docs/plant.md and writes plant_check.html.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np

from catenary import __version__
from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit import FitOptions, choose_inputs, fit
from catenary.calibration.model import CalibrationModel
from catenary.jobs.calibrate import POSITIONING_INPUTS
from catenary.jobs.paper_table import (
    HOMINGS_LINEAR_J2,
    LOADED_LINEAR_HOUR_0,
    SIX_HOURS_LINEAR,
    TABLE_1,
    TABLE_1_DIRECTIONS,
)
from catenary.jobs.simulated_recording import record_simulated
from catenary.page import Block, Heading, Table, Text, write_page
from catenary.plant import MotionLog
from catenary.reproduce.plant_refit import SPARSITIES, START, TEST_SECONDS, errors
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.plant_state import restore_plant, save_plant
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import Direction, zigzag

UNITS = "deg, deg, mm"
HOMINGS = 5
SIX_HOURS = 6.0 * 3600.0


def homed(**options: float) -> CablePlant:
    """The nominal arm, homed."""
    plant = CablePlant(load_cable_arm(), start=START, substeps=1, **options)  # type: ignore[arg-type]
    plant.home()
    return plant


def random_log(plant: CablePlant, name: str, seconds: float, seed: int) -> MotionLog:
    """Record random motion."""
    rng = np.random.default_rng(seed)
    return record_simulated(plant, random_sinusoids(rng, seconds), name, rng)


def linear_model(train: MotionLog) -> CalibrationModel:
    """A linear model of the positioning joints' positions and torques.

    Not of the tool's: it stands elsewhere after homing again, which a model of all 16 inputs takes for unknown ground.
    """
    options = FitOptions(kind="linear", inputs=POSITIONING_INPUTS)
    inputs = choose_inputs([train], options)
    return fit(calibration_data([train], inputs.features), inputs, options)


def rmse(model: CalibrationModel, log: MotionLog, part: slice = slice(None)) -> Floats:
    """RMSE after the model on a part of a recording, deg and mm."""
    data = calibration_data([log], model.features)
    keep = np.zeros(len(data), dtype=bool)
    keep[part] = True
    return np.array([joint.rmse for joint in evaluate(model, data.rows(keep)).joints])


def directions() -> Table:
    """Raw and fixed-offset errors of every direction of the zig-zag, beside the paper's."""
    rows = []
    for direction in get_args(Direction):
        plant = homed()
        rng = np.random.default_rng(7)
        train = record_simulated(plant, zigzag(direction, SPARSITIES), direction, rng)
        reached = errors(train, random_log(plant, "test", TEST_SECONDS, 8))
        raw, offset = TABLE_1_DIRECTIONS[direction]
        rows.append([direction, _text(reached["raw"]), _text(raw), _text(reached["offset"]), _text(offset)])
    return Table(["direction", f"raw [{UNITS}]", "paper", "fixed offset", "paper"], rows)


def hours_and_loads(folder: Path) -> Table:
    """The linear model with a payload, after hours, and after homing again, beside the paper's."""
    plant = homed()
    rng = np.random.default_rng(7)
    model = linear_model(record_simulated(plant, zigzag("J2-J3", SPARSITIES), "train", rng))
    save_plant(plant, folder / "trained.npz")
    test = random_log(plant, "test", TEST_SECONDS, 8)
    rows = [["unloaded, at once", _text(rmse(model, test)), _text(TABLE_1["linear"])]]

    loaded = random_log(homed(payload=0.5), "loaded", TEST_SECONDS, 8)
    rows.append(["500 g, hour 0", _text(rmse(model, loaded)), _text(LOADED_LINEAR_HOUR_0)])
    log = random_log(plant, "six hours", SIX_HOURS, 9)
    hour = len(log) // 6
    rows.append(
        ["unloaded, hour 0 of 6", _text(rmse(model, log, slice(0, hour))), _text(SIX_HOURS_LINEAR[0])]
    )
    rows.append(
        ["unloaded, hour 5 of 6", _text(rmse(model, log, slice(5 * hour, None))), _text(SIX_HOURS_LINEAR[1])]
    )

    again = CablePlant(load_cable_arm(), start=START, substeps=1)
    restore_plant(again, folder / "trained.npz")
    again.state_command("enable")
    for k in range(1, HOMINGS + 1):
        random_log(again, "between", 60.0, 20 + k)  # homing begins wherever the motion ended
        again.home()
        paper = f"-, {HOMINGS_LINEAR_J2[1]:.3f}, -" if k == HOMINGS else "-"
        rows.append(
            [f"after {k} homings", _text(rmse(model, random_log(again, "after", 300.0, 40 + k))), paper]
        )
    (folder / "trained.npz").unlink()
    return Table(["linear model", f"RMSE [{UNITS}]", "paper"], rows)


def _text(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def main(folder: Path) -> None:
    """Print the tables and write the page."""
    folder.mkdir(parents=True, exist_ok=True)
    blocks: list[Block] = [
        Text(
            "The plant was fitted to direction J2-J3 (raw, fixed offset, linear) and then frozen; the rest was not."
        ),
    ]
    for title, table in (
        ("Every direction", directions()),
        ("Payload, hours, homing", hours_and_loads(folder)),
    ):
        blocks += [Heading(title), table]
        print(f"\n{title}\n\n| " + " | ".join(table.header) + " |\n|" + "---|" * len(table.header))
        for row in table.rows:
            print("| " + " | ".join(row) + " |", flush=True)
    write_page(
        folder / "plant_check.html",
        "The simulated RAVEN-II where it was not fitted",
        "Beside Peng et al., a real robot.",
        blocks,
        footer=f"catenary {__version__}",
        simulated=True,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
