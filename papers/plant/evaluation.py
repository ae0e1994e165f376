"""What a simulated RAVEN-II comes to in the calibration paper's experiments: RMSE on J1 [deg], J2 [deg], J3 [mm].

Conditions: box J1 20..60, J2 55..110 deg, J3 0.33..0.42 m; zig-zag at 1/2 + 1/3 + 1/4; test on 20 minutes of
independent random motion; state at 30 Hz, encoders at 100 Hz.
"""

from collections.abc import Sequence
from copy import deepcopy

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.simulation.cable_parameters import CableArm
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration import recordings
from papers.calibration.recordings import TEST_SECONDS

TESTS = 3  # motions, and robots' idlers, of which the mean is fitted
SEED = 7


def errors_of(
    plant: CablePlant, methods: Sequence[str], tests: int, test_seconds: float = TEST_SECONDS, first: int = 60
) -> dict[str, Floats]:
    """Return errors of direction J2-J3 by method: raw, after the fixed offset, and after models of all 16 inputs.

    Each the mean over test motions, of which one alone moves them by up to 12 %; their seeds begin at `first`.
    """
    train = recordings.calibration_log(plant, np.random.default_rng(SEED))
    models = {name: recordings.unguarded(recordings.fitted([train], recordings.METHODS[name])) for name in methods}
    tested = []
    for k in range(tests):
        log = recordings.random_log(deepcopy(plant), np.random.default_rng(first + k), test_seconds)
        data = {name: recordings.rows_of(model, log) for name, model in models.items()}
        of_models = {name: recordings.rmse(model, data[name]) for name, model in models.items()}
        tested.append(recordings.baselines(models[methods[0]], data[methods[0]]) | of_models)
    return {name: np.mean([each[name] for each in tested], axis=0) for name in tested[0]}


def mean_errors(arm: CableArm, test_seconds: float = TEST_SECONDS) -> dict[str, Floats]:
    """Return errors in direction J2-J3, the mean over three motions, each of a robot whose idlers stand otherwise."""
    tested = []
    for k in range(TESTS):
        turned = arm.cable.idler_phase + np.random.default_rng(k).uniform(-np.pi, np.pi, 3) * (k > 0)
        plant = recordings.homed(None, arm=arm._replace(cable=arm.cable.replace(idler_phase=turned)))
        tested.append(errors_of(plant, ("linear", "polynomial"), 1, test_seconds, 60 + k))
    return {name: np.mean([each[name] for each in tested], axis=0) for name in tested[0]}


def linear_model(train: MotionLog) -> CalibrationModel:
    """Fit a linear model of the positioning joints' positions and torques.

    Not of the tool's: it stands elsewhere after homing again, which a model of all 16 inputs takes for unknown ground.
    """
    return recordings.fitted([train], FitOptions(kind="linear", inputs=POSITIONING_INPUTS))
