"""Every experiment by its name, in the papers' order; imported when it is asked for."""

import importlib
from collections.abc import Sequence

from catenary.errors import InputError
from papers.experiment import Experiment

# "paper-place": the module that holds EXPERIMENT, or module:NAME where it holds several
MODULES = {
    "plant-targets": "papers.plant.reached",
    "calibration-figure-3": "papers.calibration.figure_3",
    "calibration-table-1": "papers.calibration.table_1",
    "calibration-figure-5": "papers.calibration.figure_5",
    "calibration-figure-6": "papers.calibration.figure_6",
    "calibration-figure-7": "papers.calibration.figure_7",
    "calibration-figure-8": "papers.calibration.figure_8",
    "calibration-table-2": "papers.calibration.table_2",
    "calibration-figure-9": "papers.calibration.homings",
    "calibration-table-3": "papers.calibration.tables_3_and_4:TABLE_3",
    "calibration-table-4": "papers.calibration.tables_3_and_4:TABLE_4",
    "calibration-table-5": "papers.calibration.table_5",
    "calibration-ablation": "papers.calibration.ablation",
    "calibration-dvrk": "papers.calibration.dvrk",
    "gravity-figure-7": "papers.gravity.static_poses:FIGURE_7",
    "gravity-figure-8": "papers.gravity.static_poses:FIGURE_8",
    "gravity-figure-9": "papers.gravity.figures_9_and_10:FIGURE_9",
    "gravity-figure-10": "papers.gravity.figures_9_and_10:FIGURE_10",
    "gravity-passive": "papers.gravity.passive",
    "gravity-steps": "papers.gravity.steps",
    "gravity-joint-3": "papers.gravity.joint_3",
    "gravity-own-compensation": "papers.gravity.own_compensation",
    "gravity-adaptive": "papers.gravity.figures_9_and_10:ADAPTIVE_COMPENSATION",
    "gravity-frequency": "papers.gravity.frequency",
    "gravity-sensing": "papers.gravity.sensing",
    "gravity-faults": "papers.gravity.faults",
    "regressor-figure-2": "papers.regressor.figure_2",
    "regressor-figure-4": "papers.regressor.figures_4_and_5:FIGURE_4",
    "regressor-figure-5": "papers.regressor.figures_4_and_5:FIGURE_5",
    "regressor-replay": "papers.regressor.recorded_arms",
    "regressor-payload": "papers.regressor.unknown_payload",
    "regressor-identification": "papers.regressor.identification",
    "tutorial-two-link": "papers.tutorial.two_link",
    "beyond-paths": "papers.beyond.paths",
    "beyond-rehoming": "papers.beyond.rehoming",
    "beyond-day-after": "papers.beyond.day_after",
    "beyond-tilted-calibration": "papers.beyond.tilted_calibration",
    "beyond-calibration-and-gravity": "papers.beyond.calibration_and_gravity",
    "beyond-accuracy-latency-drift": "papers.beyond.accuracy_latency_drift",
    "beyond-wrist-friction": "papers.beyond.wrist_friction",
    "beyond-wrist-everything": "papers.beyond.wrist_friction:EVERYTHING",
    "beyond-intervals": "papers.beyond.intervals",
}


def experiment(name: str) -> Experiment:
    """Import an experiment by its name."""
    module, _, attribute = MODULES[name].partition(":")
    loaded: Experiment = getattr(importlib.import_module(module), attribute or "EXPERIMENT")
    return loaded


def named(words: Sequence[str]) -> list[str]:
    """Return the experiments that words ask for: a name, the beginning of several names, or all."""
    names: list[str] = []
    for word in words:
        matches = [name for name in MODULES if word in ("all", name)] or [
            name for name in MODULES if name.startswith(f"{word}-")
        ]
        if not matches:
            raise InputError(f'experiment "{word}": no such one; choices: all, {", ".join(MODULES)}')
        names += [name for name in matches if name not in names]
    return names
