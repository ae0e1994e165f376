"""Models of all 138 columns of the robot's state: the polynomial, in principal axes, and a larger network."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from sklearn.preprocessing import PolynomialFeatures

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.neural import PAPER, PAPER_LARGER, NetworkSettings
from catenary.calibration.predictors import Network, fit_polynomial
from catenary.calibration.valid_range import standardisation
from papers.calibration.networks import network_model, parameters
from papers.calibration.recordings import SETS, fitted, rows_of, unguarded
from papers.calibration.sessions import DENOMINATORS, HOUR, recorded
from papers.calibration.six_hours import INPUTS, fit_options, joint_rmse, left_by, measured
from papers.experiment import Outcomes, Result, run
from papers.kit import JOINTS

TOLERANCE = 1e-9  # of the largest singular value of the standardised inputs
ALL = ("all", "stamped")  # columns of `six_hours`
LARGER = "larger network"


def principal(data: CalibrationData) -> tuple[Floats, Floats, Floats]:
    """Return mean (F,), scale (F,) and axes (F, r) of inputs, those with a singular value above `TOLERANCE`."""
    mean, scale = standardisation(data.X)
    R = np.linalg.qr((data.X - mean) / scale, mode="r")
    _, values, Vt = np.linalg.svd(R)
    axes: Floats = Vt[values > TOLERANCE * values[0]].T
    return mean, scale, axes


@run(revision=1)
def all_inputs(
    seed: int | None,
    columns: str,
    sets: Sequence[str],
    network: int,
    epochs: int,
    zigzags: Sequence[int] = DENOMINATORS,
    hour_seconds: float = HOUR,
) -> Result:
    """Fit the polynomial of 138 inputs and the larger network; return their errors in six unloaded hours.

    Args:
        seed: The robot.
        columns: "all" or "stamped".
        sets: Training sets.
        network: Seed of the network.
        epochs: Of its training.
        zigzags: Denominators of the sparsities that are recorded.
        hour_seconds: How long an hour takes.

    Returns:
        `polynomial` and `larger network`: by training set, RMSE on J1 [deg], J2 [deg], J3 [mm] by hour; `ranks`: by
        training set, that of the inputs, the polynomial's terms in as many axes, and their rank.
    """
    session = recorded(seed, "unloaded", zigzags=zigzags, hour_seconds=hour_seconds, columns=("all",))
    found: dict[str, dict[str, Any]] = {"polynomial": {}, LARGER: {}, "ranks": {}}
    settings = replace(PAPER_LARGER, epochs=epochs)
    for name in sets:
        training = session.training(name)
        linear = fitted(training, fit_options("linear", "error", columns))
        data = calibration_data(training, linear.features)
        mean, scale, axes = principal(data)
        scores = (data.X - mean) / scale @ axes
        polynomial = fit_polynomial(scores, data.error)
        tests = [rows_of(linear, log) for log in session.test.values()]
        found["polynomial"][name] = [
            joint_rmse(test.error - polynomial.predict((test.X - mean) / scale @ axes)) for test in tests
        ]
        monomials = PolynomialFeatures(2, include_bias=False).fit_transform(scores / scores.std(axis=0))
        rank = int(np.linalg.matrix_rank(monomials - monomials.mean(axis=0)))
        found["ranks"][name] = [axes.shape[1], monomials.shape[1], rank]
        larger = network_model(training, settings, inputs=INPUTS[columns], seed=network)
        found[LARGER][name] = [joint_rmse(left_by(unguarded(larger), test)) for test in tests]
    return found


@run(revision=1)
def sizes() -> Result:
    """Count the weights and biases of the networks, and a linear model's per joint; nothing is trained."""

    def size(inputs: int, settings: NetworkSettings) -> int:
        widths = (inputs, *settings.hidden, len(JOINTS))
        layers = list(pairwise(widths))
        empty = Network(
            np.zeros(inputs),
            np.ones(inputs),
            tuple(np.zeros(shape) for shape in layers),
            tuple(np.zeros(width) for _, width in layers),
            settings.activation,
            np.zeros(len(JOINTS)),
            np.ones(len(JOINTS)),
        )
        return parameters(empty)

    return {
        "network of 16": size(16, PAPER),
        "network of 138": size(138, PAPER),
        "larger network of 138": size(138, PAPER_LARGER),
    }


def by_set(o: Outcomes, model: str, columns: str, sets: Sequence[str] = SETS) -> dict[str, Floats]:
    """Return errors by training set, the mean of the hours by robot and joint, (robots, 3); without those not run."""
    if columns == "16" or model not in ("polynomial", LARGER):
        found = measured(o, "unloaded", model, sets, columns=columns)
        return dict(zip(sets, found.mean(axis=2).swapaxes(0, 1), strict=False)) if found.size else {}
    rows: dict[str, list[Floats]] = {}
    for result in o.of(all_inputs, columns=columns):
        for name in sets:
            if name in result[model]:
                rows.setdefault(name, []).append(np.mean(result[model][name], axis=0))
    return {name: np.array(values) for name, values in rows.items()}
