"""A geared arm whose truth is Pinocchio's: rotors are found, masses stay, and a payload is weighed."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import Identification, identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.payload import estimate_payload
from catenary.identification.samples import prepare
from catenary.identification.torque_doubts import torque_findings
from catenary.robots.actuation import MotorInertia, StatedDrive, default_actuation, stated_actuation
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf
from catenary.workflows.identify import _notes as workflow_notes
from catenary.workflows.identify import part_of_arm
from moving_arm import recorded, sinusoids, torques
from oracles.geared_arm import ROTORS, ur10_gravity, ur10_log, write_ur10
from oracles.seven_joint_arm import plain_gravity, seven_joint_arm, seven_joint_log

LEVEL = [0.0, 0.0, -9.81]


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
def found(arm) -> Identification:
    return identify([log(0)], arm, tests=[log(1)])


def gravity_errors(robot):
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    return np.sqrt(np.mean((gravity_torque(robot, q, LEVEL) - ur10_gravity(q)) ** 2, axis=0))


def test_gravity_of_an_identified_geared_arm_is_true(found, wrong):
    assert (gravity_errors(found.robot()) < 0.2).all()
    assert found.tests[0].verdict == "holds"
    assert len(found.friction) <= 2  # there is Coulomb and viscous friction alone
    # masses of a file that is 20 % off: torques tell better
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (200, 6))
    off = np.sqrt(np.mean((0.2 * ur10_gravity(q)) ** 2, axis=0))
    other = gravity_errors(identify([log(0), log(1)], wrong).robot())
    assert (other[1:3] < 0.05 * off[1:3]).all()
    assert (other < 0.3).all()


def test_rotors_are_found_each_with_its_error(found):
    assert len(found.rotors) == 6
    for rotor, true in zip(found.rotors, ROTORS, strict=True):
        assert rotor.inertia == pytest.approx(true, rel=0.03)
        if rotor.error is not None:  # that of the pan moves like its link, with the file's inertia beside it
            assert abs(rotor.inertia - true) < 4.0 * rotor.error
    assert found.rotors[0].error is None
    assert all(rotor.error is not None for rotor in found.rotors[2:])


def test_torques_of_a_geared_arm_are_in_no_doubt(arm):
    options = IdentifyOptions(consistent=False, friction=())
    for rotors in (ROTORS, 0.0 * ROTORS):
        samples = prepare(ur10_log(0, rotors=rotors), arm, options)
        for find in (True, False):
            result = identify([log(0)], arm, replace(options, find_rotors=find))
            assert torque_findings(replace(result, training=(result.compare(samples),)), samples, fitted=True) == []


def test_currents_read_as_torques_get_no_factors_that_masses_do_not_tell(found, arm):
    amps = replace(log(0), tau=log(0).tau / 10.0)
    options = IdentifyOptions(consistent=False, friction=())
    own, loaded = prepare(amps, arm, options), ur10_log(3, payload=(5.0, [0.02, 0.1922, 0.05]))
    loaded = prepare(replace(loaded, tau=loaded.tau / 10.0), arm, options)
    for result, samples, fitted in (identify([amps], arm, options), own, True), (found.test([loaded]), loaded, False):
        [finding] = torque_findings(result, samples, fitted=fitted, may_carry=not fitted)
        assert finding.name == "torques"
        assert "of every joint" in finding.remedy
        assert "masses tell nothing of wrist_1_joint, wrist_2_joint, wrist_3_joint" in finding.remedy


def test_a_payload_of_a_geared_arm_is_weighed(found, arm):
    place = [0.02, 0.1922, 0.05]
    samples = [prepare(ur10_log(3, payload=(5.0, place)), arm, IdentifyOptions())]
    estimate = estimate_payload(found, samples, at=("wrist_3_link", place))
    assert estimate.mass == pytest.approx(5.0, rel=0.005)
    # torques of the wrist that friction and a rotor made alone are no currents where a load hangs on it
    assert torque_findings(found.test(samples), samples[0], fitted=False, may_carry=True) == []


def test_rotors_that_are_known_are_taken_as_they_are(arm, found):
    stated = identify([log(0)], arm, IdentifyOptions(rotors=tuple(ROTORS), friction=()), tests=[log(1)])
    assert (gravity_errors(stated.robot()) < 0.2).all()
    assert [(rotor.inertia, rotor.error) for rotor in stated.rotors] == [(value, None) for value in ROTORS]
    still, turned = np.zeros((2, 6)), np.vstack([np.zeros(6), np.ones(6)])
    for result in (stated, found):
        link = result.predict(still, still, turned)
        loads = result.robot().actuation
        assert loads is not None
        assert len(loads.motor_inertia) == 6
        assert np.isfinite(link).all()
    assert_allclose(
        stated.predict(still, still, turned), found.predict(still, still, turned), rtol=0.05, atol=0.5
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


PLAIN = IdentifyOptions(friction=())
Q7 = np.random.default_rng(9).uniform(-2.0, 2.0, (200, 7))
WRONG = np.random.default_rng(1).uniform(0.8, 1.2, 7)  # masses of a file, over the true ones


def size(torques):
    return np.sqrt(np.mean(torques**2, axis=0))


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


@pytest.mark.parametrize(("name", "hidden"), [("planar_3r", ("link2",)), ("two_link", ("link0", "link1"))])
def test_a_rotor_that_the_motion_does_not_show_is_told_by_its_joint_and_the_others_are_found(name, hidden):
    arm = load_robot(name)
    rotors = tuple(MotorInertia(*row) for row in zip(arm.joint_names, np.eye(arm.n), strict=True))
    beside = np.append(np.full(3 * arm.n, 0.3), np.full(arm.n, 0.5))
    geared = replace(arm, actuation=replace(default_actuation(arm.joint_names), motor_inertia=rotors))
    time = np.arange(6000) / 200.0
    q, qd, qdd = sinusoids(np.random.default_rng(0), arm, time)
    for each in (q, qd, qdd):  # in step: what asks for the first joint's acceleration asks for the second's
        each[:, 1] = 0.7 * each[:, 0]
    tau = torques(geared, q, qd, qdd, beside)
    result = identify([recorded(geared, 0, q_nominal=q, qd=qd, tau=tau)], arm, PLAIN)
    assert result.unshown == hidden
    [note] = [note for note in workflow_notes(arm, result) if "not shown by the motion" in note]
    assert ", ".join(hidden) in note
    assert not any("predicted no better" in note for note in workflow_notes(arm, result))
    assert all(rotor.inertia == pytest.approx(0.5, rel=0.1) for rotor in result.rotors if rotor.error is not None)
