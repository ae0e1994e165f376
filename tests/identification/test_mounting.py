"""Gravity that was forgotten is named, on every mounting; what is no mounting is not taken for one."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.gravity.torque import gravity_torque
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.mounting import fitted_gravity, mounting_finding
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from moving_arm import recorded
from oracles.geared_arm import ur10_log, write_ur10

LEVEL = np.array([0.0, 0.0, -9.81])
OPTIONS = IdentifyOptions()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_urdf(write_ur10(tmp_path_factory.mktemp("ur10")))


@pytest.mark.parametrize(
    ("gravity", "said", "option"),
    [
        ((9.81, 0.0, 0.0), "on a wall, its x axis down", "9.81,0,0"),
        ((0.0, -9.81, 0.0), "on a wall, its y axis up", "0,-9.81,0"),
        ((0.0, 0.0, 9.81), "hangs from a ceiling", "0,0,9.81"),
        ((6.937, 0.0, -6.937), "tilted, 45 deg", "6.9"),
    ],
)
def test_the_mounting_that_fits_is_named(arm, gravity, said, option):
    samples = prepare(ur10_log(0, gravity=gravity), arm, OPTIONS)
    finding = mounting_finding(arm, samples, LEVEL)
    assert finding is not None
    assert finding.name == "gravity"
    assert said in finding.says
    assert finding.remedy.startswith(f"--gravity {option}")
    assert mounting_finding(arm, samples, np.array(gravity)) is None
    found = fitted_gravity(arm, samples, LEVEL)
    assert found is not None
    assert (np.abs(found[0] - gravity) < 0.1).all()


@pytest.mark.parametrize("spoil", [np.ones(6), np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0]), -np.ones(6)])
def test_torques_of_a_wrong_sign_are_no_mounting(arm, spoil):
    log = ur10_log(0)
    assert mounting_finding(arm, prepare(replace(log, tau=spoil * log.tau), arm, OPTIONS), LEVEL) is None


def test_poses_at_rest_on_a_wall_are_named_and_turned_torques_are_left_to_the_sign():
    raven, rng = load_robot("raven2"), np.random.default_rng(0)
    q = rng.uniform(raven.lower, raven.upper, (300, 3))
    static = IdentifyOptions(terms="static")
    for gravity, turned, named in (([0.0, 9.81, 0.0], 1.0, True), (LEVEL, 1.0, False), (LEVEL, -1.0, False)):
        tau = turned * gravity_torque(raven, q, gravity) + rng.normal(0.0, 0.05, q.shape)
        log = recorded(raven, 0, q_nominal=q, qd=None, time=None, tau=tau, ok=np.ones(300, dtype=bool))
        assert (mounting_finding(raven, prepare(log, raven, static), LEVEL) is not None) == named
