"""Arms that changed, or were moved otherwise, in a known way: the verdict names it."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.identification.explanations.findings import findings_against
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from moving_arm import recorded, torques

ARM = load_robot("raven2")
PLAIN = IdentifyOptions(friction=())


@pytest.fixture(scope="module")
def identified():
    return identify([recorded(ARM, 0, noise=0.02)], ARM, PLAIN)


def judged(identified, log):
    return identified.test([prepare(log, ARM, PLAIN)]).tests[-1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda log, tau: tau + np.array([0.0, 2.0, 0.0]), "the constant of elbow is +2 Nm from the one identified"),
        (lambda log, tau: tau + [0.0, 1.5, 0.0] * np.sign(log.qd), "friction of elbow differs by +1.6 Nm"),
        (lambda log, tau: tau * [1.0, 1.5, 1.0], "torques of elbow are 1.4"),
        (lambda log, tau: np.roll(tau, 8, axis=0), "come 40 ms too late"),
    ],
)
def test_a_change_is_named_with_its_size(identified, change, message):
    log = recorded(ARM, 1)
    log = replace(log, tau=change(log, np.array(log.tau)))
    assert judged(identified, log).verdict in ("drifted", "fails")
    [finding] = findings_against(identified, prepare(log, ARM, PLAIN))
    assert message in finding.says


def test_a_joint_that_hardly_moves_does_not_make_a_drift(identified):
    log = recorded(ARM, 1)
    q, qd = np.array(log.q_nominal), np.array(log.qd)
    q[:, 1], qd[:, 1] = q[0, 1] + 0.01 * (q[:, 1] - q[0, 1]), 0.01 * qd[:, 1]
    qdd = np.gradient(qd, 1.0 / 200.0, axis=0)
    tau = torques(ARM, q, qd, qdd, np.full(9, 0.3))
    tau[:, 1] += 3.0  # whatever friction at rest holds there
    result = judged(identified, replace(log, q_nominal=q, qd=qd, tau=tau))
    assert result.verdict == "unclear"
    assert result.reasons[0].startswith("too little motion in joint elbow: ")


def test_a_joint_that_moves_where_nothing_was_fitted_does_not_make_a_drift(identified):
    narrow = recorded(ARM, 0)
    middle = np.mean(narrow.q_nominal, axis=0)
    q = middle + 0.2 * (narrow.q_nominal - middle)
    qd = 0.2 * np.array(narrow.qd)
    qdd = np.gradient(qd, 1.0 / 200.0, axis=0)
    small = replace(narrow, q_nominal=q, qd=qd, tau=torques(ARM, q, qd, qdd, np.full(9, 0.3)))
    fitted = identify([small], ARM, PLAIN)
    log = recorded(ARM, 1)
    stop = np.maximum(np.array(log.q_nominal)[:, 1] - q[:, 1].max() - 0.1, 0.0)  # a bumper that was never reached
    result = judged(fitted, replace(log, tau=np.array(log.tau) + 60.0 * np.eye(3)[1] * stop[:, None]))
    assert result.verdict == "unclear"
    assert any("and was identified from" in reason for reason in result.reasons)
