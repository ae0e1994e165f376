from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.errors import InputError
from catenary.identification.explanations.findings import findings_against
from catenary.identification.explanations.loads import point_mass
from catenary.identification.identification import identify
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.payload import estimate_payload, payload_candidates
from catenary.identification.samples import prepare
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import LinkInertia
from catenary.spatial import Pose
from moving_arm import LEVEL, recorded, sinusoids, slow

ARM = load_robot("raven2")
PLAIN = IdentifyOptions(friction=())
PLACE = np.array([0.02, -0.1, 0.05])


@pytest.fixture(scope="module")
def identified():
    return identify([recorded(ARM, 0, noise=0.2)], ARM, PLAIN)


def loaded(mass, frame="wrist", seed=1):
    heavy = ARM.with_payload(frame, mass, PLACE)
    return [prepare(recorded(heavy, seed, noise=0.2), ARM, PLAIN)]


def test_a_point_mass_has_the_torques_of_the_robot_that_carries_it():
    q, qd, qdd = sinusoids(np.random.default_rng(0), ARM, np.linspace(0, 2, 9))
    link = ARM.link_names.index("elbow")
    Y = torque_regressor(ARM, q, qd, qdd, LEVEL)[:, :, 10 * link : 10 * link + 10]
    heavy = ARM.with_payload("elbow", 0.4, PLACE)
    more = inverse_dynamics(heavy, q, qd, qdd, LEVEL) - inverse_dynamics(ARM, q, qd, qdd, LEVEL)
    assert_allclose(Y @ (0.4 * point_mass(PLACE)), more, atol=1e-12)


@pytest.mark.parametrize("frame", ["shoulder", "elbow", "wrist"])
def test_a_mass_at_a_known_place_is_weighed(identified, frame):
    payload = estimate_payload(identified, loaded(0.2, frame), at=(frame, PLACE))
    assert abs(payload.mass - 0.2) < max(0.02, 2.0 * payload.mass_std)
    if frame == "shoulder":  # moved by one joint, whose torque may as well have another gain
        assert payload.rival == "shoulder's torque times a gain: no single joint's motion would distinguish them"
    assert payload.mass_std < 0.1
    assert payload.detected or frame != "wrist"
    assert payload.link == ARM.link_names[ARM.frame(frame).link]


@pytest.mark.parametrize("at", [("wrist", PLACE), None])
def test_an_unloaded_arm_carries_no_payload(identified, at):
    payload = estimate_payload(identified, loaded(0.0), at=at)
    assert not payload.detected
    assert payload.confidence < 0.997


def test_less_mass_than_identified_is_no_payload(identified):
    samples = [prepare(recorded(ARM, 1), ARM, PLAIN)]
    heavy = identify([recorded(ARM.with_payload("wrist", 0.5, PLACE), 0)], ARM, PLAIN)
    payload = estimate_payload(heavy, samples, at=("wrist", PLACE))
    assert payload.mass == pytest.approx(-0.5, abs=0.05)
    assert not payload.detected


def test_mass_and_place_are_found_on_the_link_that_carries_them(identified):
    candidates = payload_candidates(identified, loaded(0.3))
    assert sorted(each.link for each in candidates) == sorted(ARM.link_names)
    assert sum(each.probability for each in candidates) == pytest.approx(1.0)
    payload = candidates[0]
    assert payload.probability > 0.95
    assert (payload.likely, payload.location) == (("insertion",), "on insertion")
    assert payload.link == "insertion"  # which the wrist is a frame of
    assert payload.mass == pytest.approx(0.3, abs=0.05)
    pose = ARM.frame("wrist").pose
    true = 0.3 * (pose.rotation @ PLACE + pose.position)
    assert (np.abs(payload.moment - true) < np.maximum(0.005, 2.0 * payload.moment_std)).all()


def parallelogram():
    """Two bars that one coordinate turns alike, and a forearm on the first."""
    body = LinkInertia(1.0, np.array([0.2, 0.0, 0.02]), 0.02 * np.eye(3))
    rows = [("lower", "base", "q1", 0.0), ("upper", "base", "q1", 0.1), ("forearm", "lower", "q2", 0.4)]
    links = [
        Link(name, parent, "revolute", Pose(np.eye(3), np.array([x, 0.0, 0.0])), np.array([0.0, 1.0, 0.0]),
             {joint: 1.0}, inertia=body)
        for name, parent, joint, x in rows
    ]  # fmt: skip
    return assemble("parallelogram", links, [Coordinate(joint, "rad", -2.0, 2.0) for joint in ("q1", "q2")])


def test_links_that_move_alike_share_the_probability():
    arm = parallelogram()
    result = identify([recorded(arm, 0, noise=0.2)], arm, PLAIN)
    heavy = arm.with_payload("upper", 0.5, np.array([0.3, 0.0, 0.05]))
    samples = [prepare(recorded(heavy, 1, noise=0.2), arm, PLAIN)]
    first, second, third = payload_candidates(result, samples)
    assert {first.link, second.link} == {"lower", "upper"}
    assert first.probability == pytest.approx(0.5, abs=0.15)
    assert second.probability == pytest.approx(0.5, abs=0.15)
    assert third.probability < 0.3
    assert {"lower", "upper"} <= set(first.likely)
    assert first.telling_joint is None
    assert "cannot be distinguished by these poses; no single joint" in first.location


def test_what_an_unloaded_recording_of_the_day_shows_is_subtracted(identified):
    aged = 0.08  # an arm that grew heavier between days, before the payload came
    today = ARM.with_payload("wrist", aged, PLACE)
    both = ARM.with_payload("wrist", aged + 0.2, PLACE)
    unloaded = [prepare(recorded(today, 1, noise=0.2), ARM, PLAIN)]
    with_it = [prepare(recorded(both, 2, noise=0.2), ARM, PLAIN)]
    biased = estimate_payload(identified, with_it, at=("wrist", PLACE))
    fair = estimate_payload(identified, with_it, at=("wrist", PLACE), unloaded=unloaded)
    assert biased.mass == pytest.approx(aged + 0.2, abs=0.02)
    assert fair.mass == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("at", "message"),
    [
        (("nose", PLACE), 'no frame "nose"'),
        (("frame0", PLACE), "does not move"),
        (("wrist", [0.0, 1.0]), "payload position: expected shape (3,)"),
    ],
)
def test_places_that_are_none_are_refused(identified, at, message):
    with pytest.raises(InputError) as caught:
        estimate_payload(identified, loaded(0.1), at=at)
    assert message in str(caught.value)


UR10E = load_robot("ur10e")
LOAD, FLANGE = 2.0, np.array([0.0, 0.0, 0.1])
AT = ("tool0", FLANGE)


def slowly(**spoilt):
    mass = spoilt.pop("mass", LOAD)
    model = UR10E.with_payload("tool0", mass, FLANGE) if mass else UR10E
    return [prepare(slow(model, 1, **spoilt), UR10E, PLAIN)]


@pytest.fixture(scope="module")
def arm():
    return identify([slow(UR10E, 0)], UR10E, replace(PLAIN, prior=False))


@pytest.mark.alike
@pytest.mark.parametrize("shift", [(1, -20.0), (2, 8.0), (4, 3.0)])
def test_a_zero_that_shifted_since_is_no_load_and_is_named(arm, shift):
    for mass, at in ((LOAD, AT), (0.0, AT), (LOAD, None)):
        samples = slowly(mass=mass, zero=[shift])
        payload = estimate_payload(arm, samples, at=at)
        assert payload.mass is None or abs(payload.mass - mass) < max(0.02, 4.0 * payload.mass_std)
        assert payload.detected is (mass > 0.0)
        assert payload.beside == f"{UR10E.joint_names[shift[0]]}'s zero of torque"


def test_the_zero_of_an_unloaded_recording_need_not_be_that_of_the_loaded_one(arm):
    free = [prepare(slow(UR10E, 2, zero=[(1, 15.0)]), UR10E, PLAIN)]
    payload = estimate_payload(arm, slowly(zero=[(2, -6.0)]), at=AT, unloaded=free)
    assert payload.mass == pytest.approx(LOAD, abs=0.02)


@pytest.mark.parametrize("seconds", [2.4, 4.0])
@pytest.mark.parametrize("zero", [(), ((1, -20.0),)])
def test_a_motion_that_does_not_separate_zero_and_load_widens_the_interval(arm, seconds, zero):
    samples = slowly(seconds=seconds, zero=zero)
    payload = estimate_payload(arm, samples, at=AT)
    assert abs(payload.mass - LOAD) < 3.0 * payload.mass_std
    assert payload.mass_std > estimate_payload(arm, slowly(), at=AT).mass_std


def test_one_pose_at_rest_tells_no_load_from_zeros_and_many_do(rng):
    arm, still = UR10E, IdentifyOptions(terms="static", friction=(), consistent=False)
    heavy = arm.with_payload("tool0", LOAD, FLANGE)

    def at_rest(model, q, name, zeros=0.0):
        tau = inverse_dynamics(model, q, 0.0 * q, 0.0 * q, LEVEL) + 0.05 * rng.normal(size=q.shape) + zeros
        fields = {"q_nominal": q, "qd": 0.0 * q, "tau": tau, "ok": np.ones(len(q), bool), "time": np.arange(len(q))}
        return recorded(model, 0, seconds=0.1, name=name, **fields)

    q = rng.uniform(-2.0, 2.0, (200, 6))
    identified = identify([at_rest(arm, q, "free")], arm, still)
    for poses, apart in ((np.tile(q[:1], (40, 1)), False), (q[:40], True)):
        for zeros in (np.array([0.0, -10.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 9.0, -6.0, 2.0, 0.0, 0.0])):
            samples = [prepare(at_rest(heavy, poses, "loaded", zeros=zeros), arm, still)]
            payload = estimate_payload(identified, samples, at=AT)
            assert abs(payload.mass - LOAD) < 3.0 * payload.mass_std
            assert not apart or (payload.detected and payload.mass_std < 0.05)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("spoilt", "name", "joints"),
    [
        ({"gain": [(1, 0.5)]}, "torques", (1,)),
        ({"gain": [(3, 0.5)]}, "torques", (3,)),
        ({"gravity": 9.81 * np.array([np.sin(0.17), 0.0, -np.cos(0.17)])}, "gravity", ()),
        ({"gravity": 9.81 * np.array([0.0, np.sin(0.17), -np.cos(0.17)])}, "gravity", ()),
        ({"zero": [(1, 20.0)]}, "offset", (1,)),
        ({}, None, ()),
    ],
)
def test_a_gain_and_a_tilted_base_are_told_beside_the_load(arm, spoilt, name, joints):
    for mass in (LOAD, 0.0):
        [samples] = slowly(mass=mass, **spoilt)
        findings = findings_against(arm, samples)
        faults = [(each.name, each.joints) for each in findings if each.refuses or each.name == "offset"]
        assert faults == ([] if name is None else [(name, tuple(UR10E.joint_names[i] for i in joints))])
        assert [each.name for each in findings].count("arm") == (mass > 0.0)
