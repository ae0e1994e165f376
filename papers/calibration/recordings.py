"""What the calibration paper's experiments are made of: a homed robot, its recordings, and models fitted to them.

Conditions: box J1 20..60, J2 55..110 deg, J3 0.33..0.42 m; calibration along zig-zags, tests on independent random
motion; state at 30 Hz, encoders at 100 Hz (Peng et al., II-D, II-E, IV-B). Errors on J1 [deg], J2 [deg], J3 [mm].
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catenary import CablePlant, MotionLog, random_sinusoids, record_simulated, zigzag
from catenary.arrays import Floats, Integers
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model import CalibrationModel, Target
from catenary.calibration.neural import NetworkSettings, fit_neural
from catenary.calibration.predictors import Expansion
from catenary.calibration.recordings import Recordings
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.calibration.valid_range import ValidRange
from catenary.simulation.cable_parameters import CableArm
from catenary.trajectories.zigzag import Direction
from papers.calibration.inputs import SIXTEEN

SPARSITIES = (1 / 2, 1 / 3, 1 / 4)  # 1013 s, of table I
TEST_SECONDS = 1200.0
# training sets of II-F to II-H: every combination of sparsities no longer than the last, the shortest first
SETS = ("1/2", "1/3", "1/4", "1/2+1/3", "1/5", "1/2+1/4", "1/3+1/4", "1/2+1/5", "1/6", "1/3+1/5", "1/2+1/3+1/4")
_NOTHING = np.zeros(0)
EVERYWHERE = ValidRange(_NOTHING, _NOTHING, _NOTHING, np.zeros((0, 0)), _NOTHING, _NOTHING)
START = (0.5, 1.5, 0.40)  # where the arm wakes up [rad, rad, m]
NETWORK, LEARNER = "network", "learner"
# the paper's methods, by the names of its tables, and ours
METHODS = {
    NETWORK: FitOptions(kind="neural", preset="paper", inputs=SIXTEEN),
    "polynomial": FitOptions(kind="polynomial", inputs=SIXTEEN),
    "linear": FitOptions(kind="linear", inputs=SIXTEEN),
    LEARNER: FitOptions(),
}


def homed(seed: int | None, *, arm: CableArm | None = None, payload: float = 0.0, side: str = "left") -> CablePlant:
    """Return a homed robot drawn by `seed` from an arm's numbers or the package's; payload at the wrist [kg]."""
    plant = CablePlant(arm, side=side, seed=seed, start=START, substeps=1, payload=payload)
    plant.home()
    return plant


def draws(seed: int | None, *what: int) -> np.random.Generator:
    """Return the random numbers of one recording: they depend on the robot and on nothing recorded before."""
    return np.random.default_rng([0 if seed is None else seed + 1, *what])


def calibration_log(
    plant: CablePlant,
    rng: np.random.Generator,
    direction: Direction = "J2-J3",
    sparsities: Sequence[float] = SPARSITIES,
    *,
    columns: Sequence[str] = (),
    other: CablePlant | None = None,
) -> MotionLog:
    """Record the zig-zags of a direction, one sparsity after the other."""
    return record_simulated(plant, zigzag(direction, sparsities), "zigzag", rng, columns=columns, other_arm=other)


def random_log(
    plant: CablePlant,
    rng: np.random.Generator,
    seconds: float = TEST_SECONDS,
    *,
    columns: Sequence[str] = (),
    other: CablePlant | None = None,
) -> MotionLog:
    """Record independent random motion of every joint."""
    return record_simulated(plant, random_sinusoids(rng, seconds), "random", rng, columns=columns, other_arm=other)


def fitted(logs: Sequence[MotionLog], options: FitOptions) -> CalibrationModel:
    """Fit a model to recordings."""
    inputs = choose_inputs(Recordings.of(logs), options)
    return fit_model(calibration_data(logs, inputs.features), inputs, options)


def network_model(
    logs: Sequence[MotionLog], settings: NetworkSettings, *, inputs: Sequence[str], seed: int, target: Target = "error"
) -> CalibrationModel:
    """Fit a network of given settings to recordings; in all else it is what `fitted` makes."""
    model = fitted(logs, FitOptions(kind="linear", inputs=inputs, target=target))
    (group,) = model.groups
    data = calibration_data(logs, model.features)
    target_values = data.error if target == "error" else data.q_nominal + data.error
    network = fit_neural(np.ascontiguousarray(data.X[:, group.columns]), target_values, settings, seed=seed)
    return replace(model, kind="neural", groups=(replace(group, predictor=network),))


def unguarded(model: CalibrationModel) -> CalibrationModel:
    """Return a model that is asked wherever the robot is, as the paper's are: no feature is watched, nothing bounds it.

    Ours gives the fixed offset outside its valid range, and where its leverage is large. The tool stands elsewhere
    after every homing, and a model that takes its positions then is outside.
    """
    nothing, groups = np.zeros(0, dtype=np.int64), []
    for group in model.groups:
        predictor = group.predictor
        free = replace(predictor, leverage=None) if isinstance(predictor, Expansion) else predictor
        groups.append(replace(group, predictor=free, valid_range=EVERYWHERE, watched=nothing))
    return replace(model, groups=tuple(groups), largest=np.full(len(model.joint_names), ANY_SIZE), limits=None)


def rows_of(model: CalibrationModel, log: MotionLog) -> CalibrationData:
    """Return a recording as rows of a model's features."""
    return calibration_data([log], model.features)


def rmse(model: CalibrationModel, data: CalibrationData) -> list[float]:
    """Return the RMSE of the corrected positions on rows that the model has not seen."""
    return [joint.rmse for joint in evaluate(model, data).joints]


def baselines(model: CalibrationModel, data: CalibrationData) -> dict[str, list[float]]:
    """Return the RMSE of raw positions, and after the fixed offset of the model's training data."""
    joints = evaluate(model, data).joints
    return {"raw": [joint.raw_rmse for joint in joints], "fixed offset": [joint.offset_rmse for joint in joints]}


def mean(values: Sequence[Sequence[float]]) -> list[float]:
    """Return the mean over trainings of each joint's error."""
    averaged: Floats = np.mean(values, axis=0)
    return [float(value) for value in averaged]


def at_rows(log: MotionLog, at: Integers) -> MotionLog:
    """Return some rows of a recording."""
    return replace(
        log,
        q_nominal=log.q_nominal[at],
        ok=log.ok[at],
        q_encoder=None if log.q_encoder is None else log.q_encoder[at],
        time=None if log.time is None else log.time[at],
        qd=None if log.qd is None else log.qd[at],
        tau=None if log.tau is None else log.tau[at],
        signals={name: values[at] for name, values in log.signals.items()},
    )
