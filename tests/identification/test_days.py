"""Recordings of several days: one set of masses, a friction each."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify
from catenary.identification.identification_file import identification_card, load_identification, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.other_causes import day_findings
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from moving_arm import slow
from oracles.geared_arm import COULOMB, ur10_gravity, ur10_log, write_ur10

LEVEL = [0.0, 0.0, -9.81]


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_urdf(write_ur10(tmp_path_factory.mktemp("ur10")))


def test_each_day_has_its_friction_and_all_have_the_masses(arm, tmp_path):
    first, last, test = ur10_log(0, friction=1.0), ur10_log(1, friction=1.4), ur10_log(2, friction=1.4)
    only = IdentifyOptions(friction=("recording",))
    found = identify([first, last], arm, only, tests=[test])
    together = identify([first, last], arm, replace(only, friction=()), tests=[test])
    assert (found.tests[0].rms < together.tests[0].rms).all()
    assert (found.tests[0].rms < 0.7 * together.tests[0].rms).sum() >= 3
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    robot = found.robot()
    assert (np.sqrt(np.mean((gravity_torque(robot, q, LEVEL) - ur10_gravity(q)) ** 2, axis=0)) < 0.2).all()
    # the robot is that of the last day
    values = dict(zip(robot.actuation.friction, np.reshape(robot.actuation.values[:18], (6, 3)), strict=True))
    for (friction, (coulomb, _, _)), true in zip(values.items(), 1.4 * COULOMB, strict=True):
        assert not friction.recording
        assert coulomb == pytest.approx(true, rel=0.05)
    save_identification(found, identification_card(found, []), tmp_path / "arm.npz")
    again, _ = load_identification(tmp_path / "arm.npz")
    np.testing.assert_array_equal(again.predict(q[:5], q[:5]), found.predict(q[:5], q[:5]))


def test_days_of_the_same_friction_share_it(arm):
    found = identify([ur10_log(0), ur10_log(1)], arm, IdentifyOptions(friction=("recording",)))
    assert not any(friction.recording for friction in found.model.actuation.friction)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("spoilt", "friction", "name"),
    [
        ({}, (), None),
        ({"zero": [(1, 20.0)]}, (), "offset"),
        ({"zero": [(1, 20.0)]}, ("recording",), None),  # a constant of its own
        ({"gain": [(1, 0.5)]}, ("recording",), "torques"),
        ({"gravity": 9.81 * np.array([np.sin(0.17), 0.0, -np.cos(0.17)])}, (), "gravity"),
    ],
)
def test_a_day_with_another_zero_gain_or_mounting_is_right_or_named(spoilt, friction, name):
    arm, options = load_robot("ur10e"), IdentifyOptions(friction=friction, prior=False)
    logs = [slow(arm, 0), replace(slow(arm, 1, **spoilt), name="spoilt")]
    found = identify(logs, arm, options)
    named = day_findings(found, [prepare(log, arm, options) for log in logs])
    assert [(each.name, each.refuses) for _, each in named] == ([(name, name != "offset")] if name else [])
    # of two days, a zero of one is as well one of the other, the other way round
    assert {where for where, each in named if each.name != "offset"} <= {"spoilt"}
    if name is None:
        q = np.random.default_rng(9).uniform(-2.0, 2.0, (200, 6))
        off = gravity_torque(found.robot(), q, LEVEL) - gravity_torque(arm, q, LEVEL)
        assert (np.sqrt(np.mean(off**2, axis=0)) < 0.05).all()
