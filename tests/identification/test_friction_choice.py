"""Simulated arms of known friction: the parts that are there are found, and none where there are none."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import path_load
from catenary.robots.catalog import load_robot
from catenary.robots.friction_terms import dahl_path
from moving_arm import LEVEL, recorded, sinusoids

ARM = load_robot("raven2")


def run(friction, seed, noise=0.05):
    """Recording in which joint `elbow` has the friction of a function of q, qd and the links' torque."""
    rng = np.random.default_rng(seed)
    time = np.arange(6000) / 200.0
    q, qd, qdd = sinusoids(rng, ARM, time)
    links = inverse_dynamics(ARM, q, qd, qdd, LEVEL)
    tau = links + 0.3 * qd + noise * rng.normal(size=q.shape)
    tau[:, 1] += friction(q[:, 1], qd[:, 1], links[:, 1])
    return recorded(ARM, seed, tau=tau)


TRUTHS = {
    "asymmetric": lambda q, qd, links: 0.4 * np.sign(qd) + 0.25 * np.abs(qd),
    "stribeck": lambda q, qd, links: np.sign(qd) * (0.5 + 1.2 * np.exp(-((qd / 0.3) ** 2))),
    "load": lambda q, qd, links: np.sign(qd) * (0.2 + 0.3 * np.abs(links)),
    "presliding": lambda q, qd, links: path_load(dahl_path, q, 0.02),
}


@cache
def identified(kind):
    return identify([run(TRUTHS[kind], 0)], ARM, tests=[run(TRUTHS[kind], 1)])


@pytest.mark.alike
@pytest.mark.parametrize("kind", TRUTHS)
def test_the_part_that_is_there_is_found_and_predicts_better(kind):
    logs, test = [run(TRUTHS[kind], 0)], run(TRUTHS[kind], 1)
    chosen = identified(kind)
    assert (("elbow", kind)) in {(part.friction, part.kind) for part in chosen.friction}
    plain = identify(logs, ARM, IdentifyOptions(friction=()), tests=[test])
    assert chosen.tests[0].rms[1] < 0.9 * plain.tests[0].rms[1]


def test_the_size_of_presliding_friction_and_its_distance_are_found():
    result = identified("presliding")
    (part,) = (p for p in result.friction if (p.friction, p.kind) == ("elbow", "presliding"))
    assert part.scale is not None
    assert 0.01 < part.scale < 0.05  # the grid's neighbours of 0.02
    loads = known_loads(result.robot())
    assert loads is not None
    # in steady sliding it is Coulomb friction of 1 Nm beside viscous friction
    sliding = loads.torque(np.zeros((2, 3)), np.array([[0, 1.0, 0], [0, -1.0, 0]]), np.zeros((2, 3)), np.zeros((2, 3)))
    assert_allclose(0.5 * (sliding[0, 1] - sliding[1, 1]), 1.0 + 0.3, atol=0.12)


def test_plain_friction_gets_hardly_any_parts():
    def coulomb(q, qd, links):
        return 0.5 * np.sign(qd)

    chosen = identify([run(coulomb, 0, noise=0.3)], ARM, tests=[run(coulomb, 1, noise=0.3)])
    assert len(chosen.friction) <= 1
    plain = identify(
        [run(coulomb, 0, noise=0.3)], ARM, IdentifyOptions(friction=()), tests=[run(coulomb, 1, noise=0.3)]
    )
    assert (chosen.tests[0].rms < 1.02 * plain.tests[0].rms).all()


def test_friction_of_a_robots_file_stands_as_it_is():
    logs = [run(TRUTHS["presliding"], 0)]
    result = identified("presliding")
    again = identify(logs, replace(result.model, actuation=replace(result.model.actuation, values=None)))
    assert not {(p.friction, p.kind) for p in result.friction} & {(p.friction, p.kind) for p in again.friction}
