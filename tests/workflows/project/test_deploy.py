from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.evaluate import evaluate
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError, LimitError, NotReadyError
from catenary.recording.logs import read_log
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.firmware_plant import restore_plant
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.smoothed_path import go_to
from catenary.workflows.project.kinds import project_kind
from catenary.workflows.project.robot import Deployment, deploy_on_robot
from catenary.workflows.simulated_recording import record_simulated
from recordings import data_of, fitted, recording
from simulated_project import POSITIONS, SHORT

SECONDS = 10.0


def plant_of(recorded: Path) -> CablePlant:
    plant = project_kind(SHORT).plant()
    restore_plant(plant, recorded / "robot" / "after_train.npz")
    plant.state_command("enable")
    return plant


def motion() -> Trajectory:
    return random_sinusoids(np.random.default_rng(7), SECONDS)


@pytest.fixture(scope="module")
def model(recorded: Path) -> CalibrationModel:
    return fitted(read_log(recorded / "train.parquet"), kind="linear", inputs=POSITIONS)


@pytest.fixture(scope="module")
def deployment(recorded: Path, model: CalibrationModel) -> Deployment:
    return deploy_on_robot(plant_of(recorded), model, motion())


def test_error_in_the_loop_is_the_evaluations(deployment, recorded, model) -> None:
    log = record_simulated(plant_of(recorded), motion(), "same", np.random.default_rng(0))
    joints = evaluate(model, data_of(log, kind="linear", inputs=POSITIONS)).joints
    # other ticks of the same motion, and the firmware's position at the end of a tick in place of its start
    assert_allclose([each.raw_rmse for each in deployment.joints], [joint.raw_rmse for joint in joints], rtol=0.05)
    assert_allclose([each.rmse for each in deployment.joints], [joint.rmse for joint in joints], rtol=0.1)


def test_the_correction_takes_no_longer_than_the_ticks_that_it_is_part_of(deployment: Deployment) -> None:
    part, whole = deployment.correction_us, deployment.compute_us
    assert part is not None
    assert whole is not None
    # the correction of each tick is within it, so is every quantile; histogram bins are 1 % wide
    assert all(0.0 < part[key] <= 1.02 * most for key, most in whole.items())


def test_what_does_not_fit_is_refused_before_anything_moves(recorded: Path, model: CalibrationModel) -> None:
    plant = plant_of(recorded)
    begin = plant.time
    other = fitted(recording(np.random.default_rng(0)), kind="linear")
    far = go_to([0.5, 1.5, 0.4], [0.5, 1.5, 4.0], max_velocity=[1, 1, 1], max_acceleration=[1, 1, 1])
    with pytest.raises(InputError):
        deploy_on_robot(plant, other, motion())
    with pytest.raises(LimitError, match="insertion"):
        deploy_on_robot(plant, model, far)
    assert plant.time == begin
    with pytest.raises(NotReadyError):
        deploy_on_robot(CablePlant(seed=1), model, motion())
