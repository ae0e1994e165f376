"""What recordings show of an arm beside its file is identified with it: bodies, and drives that two joints share."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import CarriedBody
from catenary.identification.identification_file import load_identification, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.workflows.identify import IdentifyResult, identify_files
from known_torques import TRUTHS, Truth, known_torques, true_gravity
from moving_arm import write_npz

OF = {truth.name: truth for truth in TRUTHS}


def identified(truth: Truth, folder: Path, payload: CarriedBody | None = None) -> IdentifyResult:
    path = folder / "run.npz"
    write_npz(known_torques(truth), path)
    return identify_files([path], truth.robot, IdentifyOptions(), payload=payload)


def gravity_error(robot: RobotModel, truth: Truth) -> Floats:
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, robot.n))
    off = gravity_torque(robot, q, LEVEL) - true_gravity(truth, q)
    return np.asarray(np.sqrt(np.mean(off**2, axis=0)))


def test_an_undeclared_gripper_is_a_body_of_its_own_and_gravity_is_that_of_both(tmp_path: Path) -> None:
    result = identified(OF["gripper"], tmp_path)
    [body] = result.identification.bodies
    assert body.mass == pytest.approx(0.925, abs=0.3)
    robot = result.identification.robot()
    error = gravity_error(robot, OF["gripper"])
    assert np.mean(error) < 0.03  # [Nm], of 20 and more on J2, where noise has .7
    assert error.max() < 0.06  # without priors 0.067 on J2, by the noise of 1 Nm and the motion (Cramer-Rao)
    assert robot.without_payload is not None
    assert robot.tree.mass.sum() - robot.without_payload.tree.mass.sum() == pytest.approx(body.mass)
    save_identification(result.identification, result.card, tmp_path / "arm.npz")
    assert load_identification(tmp_path / "arm.npz")[0].bodies == (body,)


def test_a_declared_payload_is_no_doubt_about_the_arm(tmp_path: Path) -> None:
    stated = CarriedBody(load_robot("ur5e").tip, 0.925, (0.0, 0.0, 0.06))
    result = identified(OF["gripper"], tmp_path, stated)
    assert result.identification.bodies == (stated,)
    assert not any("carries a body" in note for note in result.notes)
    assert np.mean(gravity_error(result.identification.robot(), OF["gripper"])) < 0.03


def test_a_drive_that_two_joints_share_is_identified_with_the_arm(tmp_path: Path) -> None:
    result = identified(OF["coupled wrist"], tmp_path)
    actuation = result.identification.model.actuation
    assert actuation is not None
    assert actuation.friction[-1].combination.tolist() == [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    assert (gravity_error(result.identification.robot(), OF["coupled wrist"]) < 0.15).all()  # [Nm]; without it .6 on J2
    assert not any("sign of its torque turns" in note for note in result.notes)


@pytest.mark.parametrize("name", ["J1 locked", "J4 locked"])
def test_a_recording_that_moves_a_joint_which_was_still_in_training_is_unclear(name: str, tmp_path: Path) -> None:
    paths = tmp_path / "still.npz", tmp_path / "moving.npz"
    for path, truth in zip(paths, (OF[name], replace(OF[name], locked=None, seed=9)), strict=True):
        write_npz(known_torques(truth), path)
    result = identify_files(paths[:1], "ur10e", IdentifyOptions(), tests=paths[1:])
    joint = load_robot("ur10e").joint_names[OF[name].locked or 0]
    [test] = result.identification.tests
    assert test.verdict == "unclear"  # of J1 30 % of its torque is left, which was within twice that of training
    assert test.reasons[0] == f"joint {joint} was still in training, and moves here: unseen"
    assert any(f"{joint}: unseen: the motion does not determine" in note for note in result.notes)
