"""Drive gains of a geared arm whose currents, load and gains are known."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.errors import ExcitationError, InputError
from catenary.identification.identification import gains_of
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.actuation import KnownTorque, default_actuation
from catenary.robots.urdf import load_urdf
from oracles.geared_arm import ROTORS, ur10_log, write_ur10

GAINS = np.array([14.0, 12.0, 11.0, 9.0, 10.0, 8.0])  # [Nm/A]
PLACE = [0.02, 0.1922, 0.05]  # [m] of the load in the last link
OPTIONS = IdentifyOptions()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_urdf(write_ur10(tmp_path_factory.mktemp("ur10")))


def currents(arm, seed, payload=None, **changes):
    log = ur10_log(seed, payload=payload, **changes)
    return prepare(replace(log, tau=log.tau / GAINS), arm, OPTIONS)


def test_gains_are_found_within_their_errors_and_so_is_the_load(arm):
    # the loaded arm rubs as on another day
    gains = gains_of([currents(arm, 0)], [currents(arm, 2, (5.0, PLACE), friction=1.1)], arm, OPTIONS, 5.0)
    assert (np.abs(gains.gains / GAINS - 1.0) < 0.03).all()
    assert (np.abs(gains.gains / GAINS - 1.0) < 4.0 * gains.errors + 0.002).all()
    assert (gains.errors < 0.03).all()
    assert np.linalg.norm(gains.centre - PLACE) < 0.01
    notes = " ".join(gains.notes(arm))
    assert "drive gains" in notes
    assert "load of 5 kg" in notes


def test_gains_that_recordings_do_not_show_are_refused_by_name(arm):
    load = currents(arm, 2, (5.0, PLACE))
    with pytest.raises(InputError, match=r"expected a recording of the arm alone, and one with a known load"):
        gains_of([load], [], arm, OPTIONS, 5.0)
    with pytest.raises(InputError, match="load: expected a mass above 0 kg"):
        gains_of([currents(arm, 0)], [load], arm, OPTIONS, 0.0)
    known = KnownTorque("cable", np.eye(6)[0], np.eye(6)[0], np.ones(1))
    aided = replace(arm, actuation=replace(default_actuation(arm.joint_names), known_torques=(known,)))
    with pytest.raises(InputError, match="are in Nm: leave them out"):
        gains_of([currents(arm, 0)], [load], aided, OPTIONS, 5.0)
    # a load that is none: what the free arm shows, once more
    with pytest.raises(ExcitationError, match="do not show the drive gain of"):
        gains_of([currents(arm, 0)], [currents(arm, 2)], arm, OPTIONS, 0.01)


@pytest.mark.slow
def test_twice_the_standard_errors_hold_the_true_gains_of_nineteen_arms_in_twenty(arm):
    held = []
    for seed in range(0, 40, 2):
        rng = np.random.default_rng(1000 + seed)
        gains, rotors, load = rng.uniform(6.0, 16.0, 6), ROTORS * rng.uniform(0.7, 1.4, 6), rng.uniform(2.0, 6.0)
        free = ur10_log(500 + seed, rotors=rotors)
        carrying = ur10_log(501 + seed, rotors=rotors, payload=(load, PLACE), friction=rng.uniform(0.85, 1.2))
        samples = [prepare(replace(each, tau=each.tau / gains), arm, OPTIONS) for each in (free, carrying)]
        estimate = gains_of(samples[:1], samples[1:], arm, OPTIONS, load)
        held.append(np.abs(np.log(estimate.gains / gains)) < 1.96 * estimate.errors)
    assert (np.sum(held, axis=0) >= 18).all()  # of 20, each joint
    assert np.sum(held) >= 110  # of 120; 95 % are 114
