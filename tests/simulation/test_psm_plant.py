"""A simulated PSM as a Plant, and the size of its errors."""

import copy
import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError, NotReadyError
from catenary.robots.catalog import load_robot
from catenary.simulation.psm_plant import PSM_JOINTS, PsmPlant
from oracles.psm_arms import homed_psm, psm_motion
from tests.truth.recordings import data_folder

FOLDER = data_folder() / "dvrk_calibration_berkeley"


def test_ticking_equals_running_bit_for_bit():
    ticked = homed_psm()
    run = copy.deepcopy(ticked)
    rows = psm_motion(run.setpoint_js().q, 1.2)  # beyond a block of the base's timeline
    log = run.run(rows)
    for k, row in enumerate(rows):
        assert_array_equal(ticked.telemetry()["jpos"], log.joint[k])
        assert_array_equal(ticked.telemetry()["q_true"], log.q[k])
        ticked.servo_jp(row)
        ticked.wait()
        assert_array_equal(ticked.telemetry()["effort"], log.torque[k])
    assert ticked.state == run.state


def test_it_goes_home_and_reports_what_the_potentiometers_say():
    plant = PsmPlant()
    assert not plant.operating_state().is_homed
    plant.home()
    controller = plant.firmware
    assert_allclose(plant.setpoint_js().q, controller.home_value, atol=1e-12)
    # a PID without integral: gravity's torque over its gain is what it lacks
    assert_allclose(plant.measured_js().q[0], -plant.measured_js().tau[0] / controller.kp[0], atol=1e-3)
    assert (np.abs(plant.measured_js().q - controller.home_value) < 0.015).all()
    error = plant.external_encoders() - plant.measured_js().q[:6]
    assert (np.abs(error[:2]) < np.deg2rad(0.3)).all()
    assert abs(error[2]) < 1e-3
    assert (np.abs(error[3:]) > np.deg2rad(2.0)).all()  # of the wrist, that nothing registers


def test_other_seeds_are_other_arms():
    one, other = PsmPlant(seed=1), PsmPlant(seed=2)
    assert (one.drive.backlash != other.drive.backlash).all()
    assert (one.state.q != other.state.q).any()
    assert PsmPlant(seed=1).drive == one.drive


def test_a_joint_that_is_held_up_stops_it_in_fault():
    plant = homed_psm()
    plant.drive.stop_upper = plant.state.q + 1e-3  # nothing moves up
    plant.drive.stop_stiffness[:] = 1e5
    rows = np.tile(plant.setpoint_js().q, (3000, 1))
    rows[:, 2] += np.minimum(np.arange(3000) * 1e-4, 0.1)
    with pytest.raises(NotReadyError, match=r"farther from its setpoint than the PID tolerates"):
        plant.run(rows)
    assert plant.operating_state().state == "FAULT"
    plant.state_command("enable")
    assert plant.operating_state().state == "ENABLED"


def test_its_tool_has_the_joints_that_it_reports():
    assert load_robot("dvrk_psm").joint_names == PSM_JOINTS[:6]
    model = load_robot("dvrk_psm")
    assert_allclose(model.lower, PsmPlant().lower[:6], atol=1e-6)
    assert_allclose(model.upper, PsmPlant().upper[:6], atol=1e-6)


@pytest.mark.parametrize("options", [{"substeps": 0}, {"start": [0.0] * 6}, {"start": [np.nan] * 7}])
def test_bad_options_are_refused(options):
    with pytest.raises(InputError):
        PsmPlant(**options)


SHOWN = np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0, *[180.0 / np.pi] * 3])  # deg, deg, mm, deg, deg, deg


def errors_of(q, error):
    """RMSE (3, 6) [deg, mm] of the last fifth: raw, less the mean of the first four, less a line fitted to them."""
    n = round(0.8 * len(q))
    inputs = np.column_stack([np.ones(len(q)), q])
    line = inputs @ np.linalg.lstsq(inputs[:n], error[:n], rcond=None)[0]
    rest = np.stack([error, error - error[:n].mean(axis=0), error - line])[:, n:]
    return np.sqrt((rest**2).mean(axis=1)) * SHOWN


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no recordings in {FOLDER}; set CATENARY_DATA")
def test_its_errors_are_as_large_as_those_of_a_real_arm():
    recorded = np.load(FOLDER / "random_train.npz")
    q = recorded["q_des"][recorded["ok"]]
    real = errors_of(q, recorded["q_act"][recorded["ok"]] - q)
    plant, rng = homed_psm(), np.random.default_rng(1)
    middle = np.array([*np.deg2rad([0.0, 0.0]), 0.18, *np.deg2rad([-20.0, -10.0, -8.0]), 0.0])
    half = np.array([*np.deg2rad([14.0, 16.0]), 0.045, *np.deg2rad([100.0, 60.0, 60.0]), 0.0])
    way = np.vstack([plant.setpoint_js().q, middle + half * rng.uniform(-1.0, 1.0, (240, 7))])
    share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, 5001) / 5000))[:, None]
    log = plant.run(np.vstack([a + (b - a) * share for a, b in itertools.pairwise(way)]))
    every = slice(0, None, 430)  # ms, as recorded
    reported = log.joint[every, :6]
    ours = errors_of(reported, plant.seen(log.q[every], np.arange(len(log.q))[every]) - reported)
    ratio = ours / real
    assert (ratio[:, 3:] < 1.6).all(), ratio  # the wrist
    assert (ratio[:, 3:] > 1.0 / 1.6).all(), ratio
    assert (ratio[:, :3] < 2.0).all(), ratio  # a camera's registration is in theirs
    assert (ratio[:, :3] > 1.0 / 2.0).all(), ratio
