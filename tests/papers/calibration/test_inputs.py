"""The paper's counts of parameters, with its inputs from a recording that carries every column."""

import numpy as np
import pytest

from catenary import CablePlant, MotionLog, random_sinusoids, record_simulated
from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit
from catenary.calibration.model import CalibrationModel
from catenary.calibration.predictors import Linear, Network
from papers.calibration.inputs import ALL_138, SIXTEEN


@pytest.fixture(scope="module")
def log() -> MotionLog:
    plant = CablePlant(substeps=1)
    plant.home()
    rng = np.random.default_rng(0)
    return record_simulated(plant, random_sinusoids(rng, 10.0), "all of it", rng, columns=("all",))


def fitted(log: MotionLog, inputs: tuple[str, ...], kind: str) -> CalibrationModel:
    options = FitOptions(kind=kind, preset="paper" if kind == "neural" else None, inputs=inputs)
    chosen = choose_inputs([log], options)
    return fit(calibration_data([log], chosen.features), chosen, options)


@pytest.mark.parametrize(("inputs", "count"), [(SIXTEEN, 16), (ALL_138, 138)])
def test_a_linear_model_has_one_parameter_per_input_and_one_more(log, inputs, count) -> None:
    model = fitted(log, inputs, "linear")
    (group,) = model.groups
    assert isinstance(group.predictor, Linear)
    assert group.predictor.weights.shape == (count, 3)  # and a bias: 17 and 139 for each joint


@pytest.mark.parametrize(("inputs", "parameters"), [(SIXTEEN, 12_103), (ALL_138, 24_303)])
def test_the_network_has_the_papers_number_of_parameters(log, inputs, parameters) -> None:
    (group,) = fitted(log, inputs, "neural").groups
    network = group.predictor
    assert isinstance(network, Network)
    assert sum(array.size for array in (*network.weights, *network.biases)) == parameters


def test_every_number_of_the_arms_state_is_carried_once(log: MotionLog) -> None:
    assert len(set(ALL_138)) == 138
    assert {"mpos:shoulder", "pos:x", "ori:33", "green_jpos:jaw2", "dt"} <= set(log.signals)
    moved = [name for name in ALL_138 if name in log.signals and np.ptp(log.signals[name]) > 0.0]
    assert {"encVals:elbow", "mvel:insertion", "mpos_d:roll", "pos:z"} <= set(moved)
    assert not {"q:unused", "tau:unused", "green_jpos:elbow"} & set(moved)
