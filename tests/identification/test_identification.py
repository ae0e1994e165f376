from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.torque_regressor import link_parameters
from catenary.errors import ExcitationError, InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.identification.consistency import pseudo_inertia
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.actuation import KnownTorque, default_actuation
from catenary.robots.catalog import load_robot
from moving_arm import LEVEL, recorded, sinusoids

ARM = load_robot("raven2")
# a filtered torque has rounded steps where Coulomb friction changes sign, the regressor has sharp ones
FILTERED = 0.1
PLAIN = IdentifyOptions(friction=())


@pytest.fixture(scope="module")
def found():
    return identify([recorded(ARM, 0)], ARM, tests=[recorded(ARM, 1)])


@pytest.fixture(scope="module")
def consistent():
    return identify([recorded(ARM, 0, noise=0.3)], ARM, IdentifyOptions(consistent=True), tests=[recorded(ARM, 1)])


def test_true_dynamics_are_predicted_on_motion_that_was_not_fitted(found):
    assert (found.tests[0].relative_rms < FILTERED).all()
    assert found.tests[0].verdict == "holds"


def test_smooth_torques_are_identified_exactly():
    smooth = replace(
        ARM, actuation=replace(default_actuation(ARM.joint_names), coulomb_velocity=2.0, find_rotors=False)
    )
    free = IdentifyOptions(cutoff_hz=100.0, consistent=False, friction=())
    result = identify([recorded(smooth, 0, rate=1000.0)], smooth, free)
    true = np.concatenate([link_parameters(ARM.tree), np.full(9, 0.3)])
    # differences at 1 kHz of 7 rad/s: (w h)^2 / 6 = 1e-5 of an acceleration
    q, qd, qdd = sinusoids(np.random.default_rng(3), smooth, np.linspace(0.0, 5.0, 100))
    expected = result.base.parameters.regressor(q, qd, qdd, LEVEL) @ true
    assert_allclose(result.predict(q, qd, qdd), expected, atol=1e-3 * np.abs(expected).max())


def test_standard_deviations_cover_the_true_parameters():
    # not drawn to the file's masses, which are the true ones
    result = identify([recorded(ARM, 2, noise=1.0)], ARM, replace(PLAIN, prior=False))
    true = result.base.combination @ np.concatenate([link_parameters(ARM.tree), np.full(9, 0.3)])
    beyond = np.abs(result.beta - true) / result.std
    assert np.median(beyond) < 2.0
    assert np.median(beyond) > 0.1


def test_known_torques_are_subtracted_and_added_again():
    known = KnownTorque("k", np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([4.0, 0.0, 7.0]))
    aided = replace(ARM, actuation=replace(default_actuation(ARM.joint_names), known_torques=(known,)))
    log = recorded(ARM, 0)
    load = np.zeros(log.tau.shape)
    load[:, 1] = 4.0 * log.q_nominal[:, 0] ** 2 + 7.0
    result = identify([replace(log, tau=log.tau + load)], aided, PLAIN)
    plain = identify([log], ARM, PLAIN)
    q = log.q_nominal[:50]
    assert_allclose(result.predict(q) - plain.predict(q), load[:50], atol=0.05)


def poses_at_rest(rng, constant):
    """Recording of 200 poses, held by gravity's torque and a constant."""
    q = rng.uniform(ARM.lower, ARM.upper, size=(200, 3))
    tau = inverse_dynamics(ARM, q, 0 * q, 0 * q, LEVEL) + constant
    return recorded(ARM, 0, q_nominal=q, qd=None, time=None, tau=tau, ok=np.ones(200, dtype=bool))


def test_poses_at_rest_show_the_gravity_torque(rng):
    constant = np.array([0.1, -0.2, 0.3])
    log = poses_at_rest(rng, constant)
    result = identify([log], ARM, IdentifyOptions(terms="static", consistent=False))
    other = rng.uniform(ARM.lower, ARM.upper, size=(20, 3))
    expected = inverse_dynamics(ARM, other, 0 * other, 0 * other, LEVEL) + constant
    assert_allclose(result.predict(other), expected, atol=1e-9)
    # bodies: the solver's tolerance, and the preference for small masses, 1e-7 of the squared torque
    bodies = identify([log], ARM, IdentifyOptions(terms="static"))
    assert_allclose(bodies.predict(other), expected, atol=1e-4)
    with pytest.raises(InputError, match="identified from poses at rest: it predicts no motion"):
        result.predict(other, other)


@pytest.mark.alike
@pytest.mark.parametrize("weighting", ["none", "range", "spread", "residual"])
def test_every_weighting_finds_the_dynamics(weighting):
    log = recorded(ARM, 0)
    result = identify([log], ARM, replace(PLAIN, weighting=weighting), tests=[recorded(ARM, 1)])
    assert (result.tests[0].relative_rms < FILTERED).all()
    if weighting == "spread":
        filtered = prepare(log, ARM, PLAIN).tau
        assert_allclose(result.weights * filtered.std(axis=0), 1.0, rtol=1e-9)


def test_recordings_that_do_not_move_show_too_little():
    still = recorded(ARM, 0)
    frozen = np.repeat(still.q_nominal[:1], len(still), axis=0)
    with pytest.raises(ExcitationError, match=r"the recordings show \d+ of \d+ base parameters.*excitation") as caught:
        identify([replace(still, q_nominal=frozen, qd=0 * frozen)], ARM)
    assert caught.value.rank < caught.value.n_base


def test_an_arm_that_changed_has_drifted_and_torques_without_sense_fail(found):
    heavier = recorded(ARM.with_payload("wrist", 0.3, [0.0, 0.0, 0.1]), 1)
    log = recorded(ARM, 1)
    shuffled = replace(log, tau=np.roll(log.tau, 700, axis=0))
    for other, verdicts in ((heavier, ("drifted", "fails")), (shuffled, ("fails",))):
        assert found.test([prepare(other, ARM, IdentifyOptions())]).tests[-1].verdict in verdicts


def test_pseudo_inertia_is_the_second_moment_of_the_mass(rng):
    points = np.column_stack([rng.normal(size=(20, 3)), np.ones(20)])
    tensor = sum(p[:3] @ p[:3] * np.eye(3) - np.outer(p[:3], p[:3]) for p in points)
    phi = np.concatenate([[20.0], points[:, :3].sum(axis=0), tensor[np.triu_indices(3)]])
    assert_allclose(pseudo_inertia(phi), points.T @ points, atol=1e-12)


def test_a_consistent_fit_costs_little_where_the_truth_is_a_body(consistent):
    free = identify([recorded(ARM, 0, noise=0.3)], ARM, IdentifyOptions(consistent=False))
    assert (consistent.training[0].rms <= 1.02 * free.training[0].rms).all()


def test_a_consistent_fit_is_a_robot_that_moves_as_the_regressor_says(consistent, rng):
    robot = consistent.robot()
    q, qd, qdd = sinusoids(rng, ARM, np.linspace(0.0, 3.0, 40))
    links = inverse_dynamics(robot, q, qd, qdd, LEVEL)
    beside = known_loads(robot).torque(q, qd, qdd, links)
    assert_allclose(links + beside, consistent.predict(q, qd, qdd), atol=1e-7)


def test_base_parameters_alone_make_no_robot():
    free = identify([recorded(ARM, 0)], ARM, replace(PLAIN, consistent=False))
    with pytest.raises(MissingInertiaError, match='"shoulder"'):
        free.robot()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"terms": "half"}, 'terms "half": expected full or static'),
        ({"weighting": "best"}, 'weighting "best": expected none, range'),
        ({"cutoff_hz": -1.0}, "cutoff_hz: expected a number above zero"),
        ({"blocks": float("nan")}, "blocks: expected a number above zero"),
        ({"friction": ("sticky",)}, 'friction "sticky": expected some of asymmetric'),
        ({"order": 0}, "order: expected 1 or more"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(options, said):
    with pytest.raises(InputError) as caught:
        IdentifyOptions(**options)
    assert said in str(caught.value)


def test_poses_at_rest_make_a_robot_of_gravity_that_refuses_motion(rng):
    robot = identify([poses_at_rest(rng, np.array([0.1, 0.0, 0.0]))], ARM, IdentifyOptions(terms="static")).robot()
    q = rng.uniform(ARM.lower, ARM.upper, size=(20, 3))
    assert_allclose(gravity_torque(robot, q, LEVEL), gravity_torque(ARM, q, LEVEL), atol=1e-4)
    assert robot.tree.mass.min() > 0.0
    with pytest.raises(MissingInertiaError, match="shoulder"):
        inverse_dynamics(robot, q, q, q, LEVEL)


def test_masses_of_the_robots_file_stand_where_torques_leave_a_choice():
    found = identify([recorded(ARM, 0, noise=0.3)], ARM, PLAIN)
    other = identify([recorded(ARM, 0, noise=0.3)], ARM, replace(PLAIN, prior=False))
    mass, smallest = (result.robot().tree.mass for result in (found, other))
    assert_allclose(mass, ARM.tree.mass, rtol=0.1)
    assert (np.abs(smallest / ARM.tree.mass - 1.0) > 0.2).any()
    assert found.prior_weight > 0.0
    assert other.prior_weight is None


def test_consistent_parameters_are_those_of_bodies(consistent):
    for place in range(3):
        J = pseudo_inertia(consistent.phi[consistent.base.parameters.link_columns(place)])
        assert np.linalg.eigvalsh(J)[0] > 0.0
    assert (consistent.base.parameters.bounds @ consistent.phi >= -1e-9).all()
