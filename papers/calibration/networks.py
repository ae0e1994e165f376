"""Networks of other sizes and trainings than a preset's, as calibration models."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catenary import MotionLog
from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel, Target
from catenary.calibration.neural import NetworkSettings, fit_neural
from catenary.calibration.predictors import Network
from papers.calibration.recordings import fitted


def network_model(
    logs: Sequence[MotionLog], settings: NetworkSettings, *, inputs: Sequence[str], seed: int, target: Target = "error"
) -> CalibrationModel:
    """Fit a network of given settings to recordings; in all else it is what `fitted` makes."""
    model = fitted(logs, FitOptions(kind="linear", inputs=inputs, target=target))
    (group,) = model.groups
    data = calibration_data(logs, model.features)
    wanted = data.error if target == "error" else data.q_nominal + data.error
    nothing_late = np.zeros(len(data), dtype=bool)
    network = fit_neural(np.ascontiguousarray(data.X[:, group.columns]), wanted, settings, seed=seed, late=nothing_late)
    return replace(model, kind="neural", groups=(replace(group, predictor=network),))


def parameters(network: Network) -> int:
    """Return how many weights and biases a network has."""
    return sum(each.size for each in (*network.weights, *network.biases))
