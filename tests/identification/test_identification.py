from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import known_loads
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.torque_regressor import link_parameters
from catenary.errors import ExcitationError, InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.identification.consistency import pseudo_inertia
from catenary.identification.explanations.findings import day_findings, explained_torques, findings_against
from catenary.identification.identification import Identification, identify
from catenary.identification.identification_file import identification_card, load_identification, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.payload import estimate_payload
from catenary.identification.samples import prepare
from catenary.robots.actuation import KnownTorque, MotorInertia, StatedDrive, default_actuation, stated_actuation
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from catenary.workflows.identify import _notes as workflow_notes
from catenary.workflows.identify import part_of_arm
from moving_arm import LEVEL, recorded, sinusoids, slow, torques
from oracles.geared_arm import COULOMB, ROTORS, ur10_gravity, ur10_log, write_ur10
from oracles.seven_joint_arm import plain_gravity, seven_joint_arm, seven_joint_log

ARM = load_robot("raven2")
# a filtered torque has rounded steps where Coulomb friction changes sign, the regressor has sharp ones
FILTERED = 0.1
PLAIN = IdentifyOptions(friction=())


@pytest.fixture(scope="module")
def identified():
    return identify([recorded(ARM, 0)], ARM, tests=[recorded(ARM, 1)])


@pytest.fixture(scope="module")
def consistent():
    return identify([recorded(ARM, 0, noise=0.3)], ARM, IdentifyOptions(consistent=True), tests=[recorded(ARM, 1)])


def test_true_dynamics_are_predicted_on_motion_that_was_not_fitted(identified):
    assert (identified.tests[0].relative_rms < FILTERED).all()
    assert identified.tests[0].verdict == "holds"


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
    true = result.base.combination @ np.concatenate([link_parameters(ARM.tree), np.full(9, 0.3), np.zeros(3)])
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


def test_an_arm_that_changed_has_drifted_and_torques_without_sense_fail(identified):
    heavier = recorded(ARM.with_payload("wrist", 0.3, [0.0, 0.0, 0.1]), 1)
    log = recorded(ARM, 1)
    shuffled = replace(log, tau=np.roll(log.tau, 700, axis=0))
    for other, verdicts in ((heavier, ("drifted", "fails")), (shuffled, ("fails",))):
        assert identified.test([prepare(other, ARM, IdentifyOptions())]).tests[-1].verdict in verdicts


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
    friction = known_loads(robot).torque(q, qd, qdd, links)
    assert_allclose(links + friction, consistent.predict(q, qd, qdd), atol=1e-7)


def test_base_parameters_alone_make_no_robot():
    free = identify([recorded(ARM, 0)], ARM, replace(PLAIN, consistent=False))
    with pytest.raises(MissingInertiaError, match='"shoulder"'):
        free.robot()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"terms": "half"}, 'terms "half": expected full or static'),
        ({"weighting": "best"}, 'weighting "best": expected none, range'),
        ({"cutoff_hz": -1.0}, "cutoff_hz: expected a number above zero"),
        ({"blocks": float("nan")}, "blocks: expected a number above zero"),
        ({"friction": ("sticky",)}, 'friction "sticky": expected some of asymmetric'),
    ],
)
def test_options_that_cannot_be_meant_are_refused(options, message):
    with pytest.raises(InputError) as caught:
        IdentifyOptions(**options)
    assert message in str(caught.value)


def test_poses_at_rest_make_a_robot_of_gravity_that_refuses_motion(rng):
    robot = identify([poses_at_rest(rng, np.array([0.1, 0.0, 0.0]))], ARM, IdentifyOptions(terms="static")).robot()
    q = rng.uniform(ARM.lower, ARM.upper, size=(20, 3))
    assert_allclose(gravity_torque(robot, q, LEVEL), gravity_torque(ARM, q, LEVEL), atol=1e-4)
    assert robot.tree.mass.min() > 0.0
    with pytest.raises(MissingInertiaError, match="shoulder"):
        inverse_dynamics(robot, q, q, q, LEVEL)


def test_masses_of_the_robots_file_stand_where_torques_leave_a_choice():
    identified = identify([recorded(ARM, 0, noise=0.3)], ARM, PLAIN)
    other = identify([recorded(ARM, 0, noise=0.3)], ARM, replace(PLAIN, prior=False))
    mass, smallest = (result.robot().tree.mass for result in (identified, other))
    assert_allclose(mass, ARM.tree.mass, rtol=0.1)
    assert (np.abs(smallest / ARM.tree.mass - 1.0) > 0.2).any()
    assert identified.prior
    assert not other.prior


def test_consistent_parameters_are_those_of_bodies(consistent):
    for place in range(3):
        J = pseudo_inertia(consistent.phi[consistent.base.parameters.link_columns(place)])
        assert np.linalg.eigvalsh(J)[0] > 0.0
    assert (consistent.base.parameters.bounds @ consistent.phi >= -1e-9).all()


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_urdf(write_ur10(tmp_path_factory.mktemp("ur10")))


@pytest.fixture(scope="module")
def wrong(arm):
    """The arm with masses that its file has 20 % too large."""
    tree = arm.tree._replace(mass=1.2 * arm.tree.mass, inertia=1.2 * arm.tree.inertia)
    return replace(arm, tree=tree)


log = cache(ur10_log)


@pytest.fixture(scope="module")
def found_geared(arm) -> Identification:
    return identify([log(0)], arm, tests=[log(1)])


def gravity_errors(robot):
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    return np.sqrt(np.mean((gravity_torque(robot, q, LEVEL) - ur10_gravity(q)) ** 2, axis=0))


def test_gravity_of_an_identified_geared_arm_is_true(found_geared, wrong):
    assert (gravity_errors(found_geared.robot()) < 0.2).all()
    assert found_geared.tests[0].verdict == "holds"
    assert len(found_geared.friction) <= 2  # there is Coulomb and viscous friction alone
    # masses of a file that is 20 % off: torques tell better
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    off = np.sqrt(np.mean((0.2 * ur10_gravity(q)) ** 2, axis=0))
    other = gravity_errors(identify([log(0), log(1)], wrong).robot())
    assert (other[1:3] < 0.05 * off[1:3]).all()
    assert (other < 0.3).all()


def test_rotors_are_found_each_with_its_error(found_geared):
    assert len(found_geared.rotors) == 6
    for rotor, true in zip(found_geared.rotors, ROTORS, strict=True):
        assert rotor.inertia == pytest.approx(true, rel=0.03)
        if rotor.error is not None:  # that of the pan moves like its link, with the file's inertia beside it
            assert abs(rotor.inertia - true) < 4.0 * rotor.error
    assert found_geared.rotors[0].error is None
    assert all(rotor.error is not None for rotor in found_geared.rotors[2:])


@pytest.mark.parametrize("rotors", [ROTORS, 0.0 * ROTORS])
def test_torques_of_a_geared_arm_are_in_no_doubt(arm, rotors):
    assert explained_torques(arm, prepare(ur10_log(0, rotors=rotors), arm, IdentifyOptions()))[0] == []


def test_currents_read_as_torques_get_no_factors_that_masses_do_not_tell(found_geared, arm):
    loaded = ur10_log(3, payload=(5.0, [0.02, 0.1922, 0.05]))
    own, loaded = (
        prepare(replace(log, tau=log.tau / np.array([9.0, 12.0, 10.0, 14.0, 8.0, 11.0])), arm, IdentifyOptions())
        for log in (log(0), loaded)
    )
    for findings in (explained_torques(arm, own)[0], findings_against(found_geared, loaded)):
        assert (findings[0].name, findings[0].refuses) == ("torques", True)
        assert "--currents with a known --load" in findings[0].remedy


def test_a_payload_of_a_geared_arm_is_weighed(found_geared, arm):
    place = [0.02, 0.1922, 0.05]
    samples = [prepare(ur10_log(3, payload=(5.0, place)), arm, IdentifyOptions())]
    estimate = estimate_payload(found_geared, samples, at=("wrist_3_link", place))
    assert estimate.mass == pytest.approx(5.0, rel=0.005)
    [load] = findings_against(found_geared, samples[0])
    assert (load.name, load.refuses) == ("arm", False)
    assert "wrist_3_link carries a body" in load.says


def test_rotors_that_are_known_are_taken_as_they_are(arm, found_geared):
    stated = identify([log(0)], arm, IdentifyOptions(rotors=tuple(ROTORS), friction=()), tests=[log(1)])
    assert (gravity_errors(stated.robot()) < 0.2).all()
    assert [(rotor.inertia, rotor.error) for rotor in stated.rotors] == [(value, None) for value in ROTORS]
    still, turned = np.zeros((2, 6)), np.vstack([np.zeros(6), np.ones(6)])
    for result in (stated, found_geared):
        link = result.predict(still, still, turned)
        loads = result.robot().actuation
        assert loads is not None
        assert len(loads.motor_inertia) == 6
        assert np.isfinite(link).all()
    assert_allclose(
        stated.predict(still, still, turned), found_geared.predict(still, still, turned), rtol=0.05, atol=0.5
    )  # what a datasheet says, and what was found
    with pytest.raises(InputError, match="rotors: expected 6 numbers, for shoulder_pan_joint"):
        identify([log(0)], arm, IdentifyOptions(rotors=(1.0,)))
    with pytest.raises(InputError, match="rotors: expected numbers of zero or more"):
        IdentifyOptions(rotors=(-1.0,))


def test_a_table_says_what_is_identified(arm):
    model = replace(arm, actuation=replace(default_actuation(arm.joint_names), find_rotors=False))
    assert identify([log(0)], model, IdentifyOptions(friction=())).rotors == ()
    known = stated_actuation(arm.joint_names, [StatedDrive("elbow_joint", damping=1.0)])  # by a description
    assert len(identify([log(0)], replace(model, actuation=known), IdentifyOptions(friction=())).rotors) == 6


Q7 = np.random.default_rng(9).uniform(-2.0, 2.0, (200, 7))
WRONG = np.random.default_rng(1).uniform(0.8, 1.2, 7)  # masses of a file, over the true ones


def size(torques):
    return np.sqrt(np.mean(torques**2, axis=0))


@pytest.mark.alike
@pytest.mark.parametrize("angle", ["1.5708", "1.570796", "1.571", "1.57"])
@pytest.mark.parametrize("inside", ["", '<dynamics damping="1" friction="1"/>'])
def test_gravity_of_an_arm_whose_file_rounds_angles_is_as_true_as_plain_least_squares(tmp_path, angle, inside):
    true, arm = seven_joint_arm(tmp_path), seven_joint_arm(tmp_path, angle, WRONG, inside)
    log, expected = seven_joint_log(true), gravity_torque(true, Q7, LEVEL)
    result = identify([log], arm, PLAIN)
    off = size(gravity_torque(result.robot(), Q7, LEVEL) - expected)
    assert (off < 1.5 * size(plain_gravity(log, arm, Q7) - expected) + 0.01).all()
    assert off.max() < 0.1 * size(gravity_torque(arm, Q7, LEVEL) - expected).max()
    assert len(result.rotors) == 7
    assert result.unshown == ()


def test_joints_of_an_arm_whose_description_states_drives_have_rotors_too(tmp_path):
    inside = '<dynamics damping="1" friction="1"/>'
    true, arm = seven_joint_arm(tmp_path), seven_joint_arm(tmp_path, "1.5708", WRONG, inside)
    joints = true.joint_names[1:]
    part, whole = (part_of_arm(each, joints, [])[0] for each in (arm, true))
    log = seven_joint_log(whole)
    result = identify([log], part, PLAIN)
    assert len(result.rotors) == 6
    expected = gravity_torque(whole, Q7[:, 1:], LEVEL)
    assert (size(gravity_torque(result.robot(), Q7[:, 1:], LEVEL) - expected) < 0.05).all()


@pytest.mark.parametrize(("name", "hidden"), [("planar_3r", ("link2",)), ("two_link", ("link1",))])
def test_a_rotor_that_the_motion_does_not_show_is_told_by_its_joint_and_the_others_are_found(name, hidden):
    arm = load_robot(name)
    rotors = tuple(MotorInertia(*row) for row in zip(arm.joint_names, np.eye(arm.n), strict=True))
    numbers = np.append(np.full(3 * arm.n, 0.3), np.full(arm.n, 0.5))
    geared = replace(arm, actuation=replace(default_actuation(arm.joint_names), motor_inertia=rotors))
    time = np.arange(6000) / 200.0
    q, qd, qdd = sinusoids(np.random.default_rng(0), arm, time)
    for each in (q, qd, qdd):  # in step: what asks for the first joint's acceleration asks for the second's
        each[:, 1] = 0.7 * each[:, 0]
    tau = torques(geared, q, qd, qdd, numbers)
    result = identify([recorded(geared, 0, q_nominal=q, qd=qd, tau=tau)], arm, PLAIN)
    assert result.unshown == hidden
    [note] = [note for note in workflow_notes(arm, result) if "that the motion does not determine" in note]
    assert ", ".join(hidden) in note
    assert all(rotor.inertia == pytest.approx(0.5, rel=0.1) for rotor in result.rotors if rotor.error is not None)


def test_each_day_has_its_friction_and_all_have_the_masses(arm, tmp_path):
    first, last, test = ur10_log(0, friction=1.0), ur10_log(1, friction=1.4), ur10_log(2, friction=1.4)
    only = IdentifyOptions(friction=("recording",))
    identified = identify([first, last], arm, only, tests=[test])
    together = identify([first, last], arm, replace(only, friction=()), tests=[test])
    assert (identified.tests[0].rms < together.tests[0].rms).all()
    assert (identified.tests[0].rms < 0.7 * together.tests[0].rms).sum() >= 3
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    robot = identified.robot()
    assert (np.sqrt(np.mean((gravity_torque(robot, q, LEVEL) - ur10_gravity(q)) ** 2, axis=0)) < 0.2).all()
    # the robot is that of the last day
    values = dict(zip(robot.actuation.friction, np.reshape(robot.actuation.values[:18], (6, 3)), strict=True))
    for (friction, (coulomb, _, _)), true in zip(values.items(), 1.4 * COULOMB, strict=True):
        assert not friction.recording
        assert coulomb == pytest.approx(true, rel=0.05)
    save_identification(identified, identification_card(identified, []), tmp_path / "arm.npz")
    again, _ = load_identification(tmp_path / "arm.npz")
    np.testing.assert_array_equal(again.predict(q[:5], q[:5]), identified.predict(q[:5], q[:5]))


def test_days_of_the_same_friction_share_it(arm):
    identified = identify([ur10_log(0), ur10_log(1)], arm, IdentifyOptions(friction=("recording",)))
    assert not any(friction.recording for friction in identified.model.actuation.friction)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("spoilt", "name", "refuses"),
    [
        ({}, None, False),
        ({"zero": [(1, 20.0)]}, "offset", False),
        ({"gain": [(1, 0.5)]}, "torques", True),
        ({"gravity": 9.81 * np.array([np.sin(0.17), 0.0, -np.cos(0.17)])}, "gravity", True),
    ],
)
def test_a_day_with_another_zero_gain_or_mounting_is_named(spoilt, name, refuses):
    arm, options = load_robot("ur10e"), IdentifyOptions()
    days = [prepare(log, arm, options) for log in (slow(arm, 0), replace(slow(arm, 1, **spoilt), name="spoilt"))]
    named = day_findings(arm, days)
    # of two days, what one has is as well the other's, the other way round
    assert {(finding.name, finding.refuses) for _, finding in named} == ({(name, refuses)} if name else set())


@pytest.mark.alike
@pytest.mark.parametrize("name", ["arm", "friction"])
def test_of_three_days_the_one_with_a_load_or_other_friction_is_named(name):
    arm, options = load_robot("ur10e"), IdentifyOptions()
    other = slow(arm.with_payload(arm.tip, 3.0, [0.0, 0.0, 0.1]) if name == "arm" else arm, 1)
    if name == "friction":
        other = replace(other, tau=other.tau + np.eye(6)[1] * (15.0 * np.tanh(other.qd / 0.01) + 8.0 * other.qd))
    days = [slow(arm, 0), slow(arm, 2), replace(other, name="other")]
    [(day, finding)] = day_findings(arm, [prepare(log, arm, options) for log in days])
    assert (day, finding.name, finding.refuses) == ("other", name, False)
