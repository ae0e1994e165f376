"""What a level floor hides, against the robot whose recordings they are: the truth lies within the bounds told."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque, unseen_torque
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.catalog import load_robot
from catenary.robots.model_record import robot_from_record, robot_record
from catenary.sensing.gravity_vector import tilted_gravity
from moving_arm import LEVEL, recorded

ARM = load_robot("ur5e")
FITTED = 0.2  # [Nm] of 40: motions of up to 7 rad/s, filtered at 40 Hz
PLAIN = IdentifyOptions(friction=(), prior=False, cutoff_hz=40.0)  # which finds the smallest masses, not the true ones


@pytest.fixture(scope="module")
def robot():
    return identify([recorded(ARM, 0, seconds=12.0)], ARM, PLAIN).robot()


def test_first_moments_about_an_upright_axis_are_unseen_on_a_level_floor(robot):
    assert len(robot.unseen) == 2
    assert all(each.low < 0.0 < each.high for each in robot.unseen)


def test_nothing_is_unseen_under_the_gravity_of_the_recordings(robot, rng):
    for q in rng.uniform(-2.0, 2.0, size=(5, 6)):
        assert_allclose(unseen_torque(robot, q, LEVEL), 0.0, atol=1e-6)
        assert_allclose(gravity_torque(robot, q, LEVEL), gravity_torque(ARM, q, LEVEL), atol=FITTED)


def test_on_a_tilt_the_true_torque_lies_within_what_is_said(robot, rng):
    tilt = tilted_gravity(0.4, 0.3)
    for q in rng.uniform(-2.0, 2.0, size=(20, 6)):
        off = np.abs(gravity_torque(robot, q, tilt) - gravity_torque(ARM, q, tilt))
        assert (off <= unseen_torque(robot, q, tilt) + FITTED).all()
        assert unseen_torque(robot, q, tilt)[0] > FITTED


def test_an_arm_whose_first_axis_lies_level_hides_nothing():
    arm = load_robot("raven2")
    assert identify([recorded(arm, 0)], arm, PLAIN).robot().unseen == ()


def test_it_stays_with_the_robot_in_its_file(robot):
    again = robot_from_record(robot_record(robot))
    for mine, theirs in zip(again.unseen, robot.unseen, strict=True):
        assert (mine.name, mine.low, mine.high) == (theirs.name, theirs.low, theirs.high)
        assert_allclose(mine.change, theirs.change)


def test_where_no_bound_can_be_found_torques_on_a_tilt_are_open_not_certain(monkeypatch):
    result = identify([recorded(ARM, 0, seconds=12.0)], ARM, PLAIN)

    def unsolved(*_):
        raise InputError("no optimum")

    monkeypatch.setattr("catenary.identification.consistency.solve_program", unsolved)
    robot = robot_from_record(robot_record(result.robot()))
    q = np.full(6, 0.3)
    assert np.isinf(unseen_torque(robot, q, tilted_gravity(0.4, 0.3))[0])
    assert_allclose(unseen_torque(robot, q, LEVEL), 0.0)
