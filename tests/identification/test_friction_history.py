import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.identification.friction_history import FrictionHistory, presliding
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.actuation import ActuationTerm
from catenary.robots.catalog import load_robot
from moving_arm import recorded

DISTANCE = 0.02


def test_presliding_friction_rises_as_dahls_law_from_rest():
    s = np.linspace(0.0, 0.1, 500)
    assert_allclose(presliding(s, DISTANCE), 1.0 - np.exp(-s / DISTANCE), atol=1e-12)


def test_presliding_friction_after_a_reversal_starts_where_it_was():
    there, back = np.linspace(0.0, 0.3, 400), np.linspace(0.3, 0.25, 300)
    z = presliding(np.concatenate([there, back[1:]]), DISTANCE)
    top = 1.0 - np.exp(-0.3 / DISTANCE)
    assert_allclose(z[400:], -1.0 + (top + 1.0) * np.exp(-(0.3 - back[1:]) / DISTANCE), atol=1e-12)


@pytest.mark.parametrize("slower", [1.0, 7.0])
def test_presliding_friction_depends_on_the_path_and_not_on_time(slower):
    # a path sampled ten times as finely: Dahl's law is in ds alone
    t = np.linspace(0.0, 6.0, 601)
    fine = np.linspace(0.0, 6.0, round(6000 * slower) + 1)
    turns = 0.3 * np.sin(t)
    z = presliding(0.3 * np.sin(fine), DISTANCE)
    coarse = presliding(turns, DISTANCE)
    # where it turns between two samples, the coarse path misses a little of the way
    assert_allclose(np.interp(t, fine, z), coarse, atol=0.01)


def test_a_step_passes_the_filter_that_the_torque_passed():
    arm = load_robot("raven2")
    log = recorded(arm, 0)
    c = np.eye(3)[0]
    stepped = np.array(log.tau)
    stepped[:, 0] = np.sign(np.array(log.qd) @ c)  # a torque that is Coulomb friction alone
    samples = prepare(recorded(arm, 0, tau=stepped), arm, IdentifyOptions())
    assert samples.history is not None
    load = samples.history.load(ActuationTerm("coulomb", "c", c), 0.0)
    # the direction is told from the filtered rate, which passes zero within a sample of the raw one
    assert_allclose(load, samples.tau[:, 0], atol=0.12)
    assert np.abs(np.sign(samples.qd @ c) - samples.tau[:, 0]).max() > 0.5


def test_rows_that_are_left_remember_all_of_the_course():
    s = np.sin(np.linspace(0.0, 10.0, 300))[:, None]
    history = FrictionHistory(((s, s),), 10, np.empty((0, 6)), np.arange(280))
    term = ActuationTerm("presliding", "d", np.ones(1), None, DISTANCE)
    every_third = np.arange(280) % 3 == 0
    assert_allclose(history.rows(every_third).load(term, 0.0), history.load(term, 0.0)[every_third])
