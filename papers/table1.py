"""Table I of the calibration paper on simulated robots: raw, fixed offset, linear, polynomial, and both networks.

Direction J2-J3, sparsities 1/2 + 1/3 + 1/4, tested on 20 minutes of random motion, networks the mean of five seeds, as
Peng et al. did; the nominal robot and five drawn ones. Run it with `make table1`; it writes table1.json and
table1.html and prints the table.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog, random_sinusoids, record_simulated, zigzag
from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit import FitOptions, choose_inputs, fit
from catenary.reports.page import Block, Table, Text
from catenary.reports.project import TABLE_1
from catenary.workflows.project.calibrate import RAVEN_INPUTS
from papers.arguments import folder_and_robots
from papers.paper_inputs import SIXTEEN
from papers.results import shown, write_files

SPARSITIES = (1 / 2, 1 / 3, 1 / 4)
TEST_SECONDS = 1200.0
ROBOTS: tuple[int | None, ...] = (None, 1, 2, 3, 4, 5)  # None is the nominal one
UNITS = ("deg", "deg", "mm")
NETWORK_SEEDS = range(5)  # the paper's are the mean of five trainings
MODELS = {
    "linear": FitOptions(kind="linear", inputs=SIXTEEN),
    "polynomial": FitOptions(kind="polynomial", inputs=SIXTEEN),
    "neural, preset paper": FitOptions(kind="neural", preset="paper", inputs=SIXTEEN),
    "neural, preset best": FitOptions(kind="neural", preset="best", inputs=RAVEN_INPUTS),
}
RANDOM_TRAINED = "neural, best, trained on random motion"
RANDOM_TRAINED_PAPER = "neural, paper, trained on random motion"


@dataclass(frozen=True)
class RobotResult:
    """RMSE per row of the table of one robot, deg and mm (networks: mean of the seeds); share outside valid ranges."""

    seed: int | None
    rmse: dict[str, Floats]
    outside: dict[str, float]


def run_robot(seed: int | None) -> RobotResult:
    """Home a robot, record calibration and test motions, fit and test every model."""
    rng = np.random.default_rng(1000 if seed is None else seed)
    plant = CablePlant(seed=seed, substeps=1)
    plant.home()
    motion = zigzag("J2-J3", SPARSITIES)
    train = record_simulated(plant, motion, "zigzag", rng)
    other = record_simulated(plant, random_sinusoids(rng, motion.duration), "random training", rng)
    test = record_simulated(plant, random_sinusoids(rng, TEST_SECONDS), "random test", rng)
    rmse: dict[str, Floats] = {}
    outside: dict[str, float] = {}
    jobs = [(name, train, options) for name, options in MODELS.items()]
    jobs += [
        (RANDOM_TRAINED_PAPER, other, MODELS["neural, preset paper"]),
        (RANDOM_TRAINED, other, MODELS["neural, preset best"]),
    ]
    for name, source, options in jobs:
        inputs = choose_inputs([source], options)
        of_seeds = []
        for network_seed in NETWORK_SEEDS if options.kind == "neural" else (0,):
            model = fit(_data(source, inputs.features), inputs, replace(options, seed=network_seed))
            joints = evaluate(model, _data(test, inputs.features)).joints
            of_seeds.append([joint.rmse for joint in joints])
        if "raw" not in rmse:
            rmse["raw"] = np.array([joint.raw_rmse for joint in joints])
            rmse["fixed offset"] = np.array([joint.offset_rmse for joint in joints])
        rmse[name] = np.mean(of_seeds, axis=0)
        outside[name] = max(joint.outside_valid_range for joint in joints)
        print(f"  robot {seed}: {name}: {np.round(rmse[name], 3).tolist()}", file=sys.stderr, flush=True)
    return RobotResult(seed, rmse, outside)


def _data(log: MotionLog, features: Any) -> CalibrationData:
    return calibration_data([log], features)


def table(results: list[RobotResult]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows: the nominal robot, mean and spread over the drawn ones, the paper's."""
    nominal, drawn = results[0], results[1:]
    header = ["RMSE (simulated)"]
    for joint, unit in zip(("J1", "J2", "J3"), UNITS, strict=True):
        header += [f"{joint} [{unit}] nominal", f"{len(drawn)} robots", "paper"]
    rows = []
    for name in nominal.rmse:
        cells = [name]
        values = np.array([result.rmse[name] for result in drawn]) if drawn else np.full((1, 3), np.nan)
        for j in range(3):
            spread = float(np.std(values[:, j], ddof=1)) if len(values) > 1 else float("nan")
            cells += [
                f"{nominal.rmse[name][j]:.3f}",
                f"{np.mean(values[:, j]):.3f} ± {spread:.3f}",
                f"{TABLE_1[name][j]:.3f}" if name in TABLE_1 else "-",
            ]
        rows.append(cells)
    return header, rows


def gains(results: list[RobotResult]) -> dict[str, list[float]]:
    """Return the RMSE of preset best over preset paper, per joint, mean over all robots."""
    pairs = {
        "trained on zig-zag": ("neural, preset best", "neural, preset paper"),
        "trained on random motion": (RANDOM_TRAINED, RANDOM_TRAINED_PAPER),
    }
    return {
        name: np.mean([result.rmse[best] / result.rmse[paper] for result in results], axis=0).tolist()
        for name, (best, paper) in pairs.items()
    }


def main(folder: Path, robots: tuple[int | None, ...] = ROBOTS) -> None:
    """Run all robots, print the table, write table1.json and table1.html."""
    results = [run_robot(seed) for seed in robots]
    ratio = gains(results)
    blocks: list[Block] = shown("RMSE on 20 minutes of random motion", Table(*table(results)))
    for name, values in ratio.items():
        told = ", ".join(f"{value:.2f}" for value in values)
        print(f"preset best over preset paper, {name}: {told}; mean {np.mean(values):.2f}")
    content = {
        "paper": TABLE_1,
        "robots": [
            {"seed": r.seed, "rmse": {k: v.tolist() for k, v in r.rmse.items()}, "outside": r.outside}
            for r in results
        ],
        "best_over_paper": ratio,
    }
    blocks += [
        Text(
            "Simulated robots: the nominal one, to which the plant was fitted, and drawn ones (ratios 1 %, stiffness "
            "15 %, friction 20 %). Networks: mean of five trainings. The paper's columns are Peng et al., table I, on "
            "a real robot."
        ),
        *(
            Text(
                f"Preset best over preset paper, {name}: "
                + ", ".join(f"{v:.2f}" for v in values)
                + " (J1, J2, J3)"
            )
            for name, values in ratio.items()
        ),
    ]
    lead = "Direction J2-J3, sparsities 1/2 + 1/3 + 1/4."
    write_files(folder, "table1", "Table I, simulated", lead, blocks, content)


if __name__ == "__main__":
    main(*folder_and_robots(__doc__, ROBOTS))
