import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.errors import CatenaryError, InputError, MissingInertiaError
from catenary.gravity.torque import potential_energy
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import LinkInertia, is_negative, unphysical
from catenary.spatial import Pose, identity_pose, rotation_from_rpy
from oracles.point_masses import cloud, inertia_of
from oracles.random_trees import random_pose
from oracles.tree_poses import frame_pose

RAVEN = load_robot("raven2")

BODY = LinkInertia(1.5, np.zeros(3), np.eye(3))


@pytest.fixture
def model():
    q = [Coordinate("q", "rad")]
    a = Link("a", "base", "revolute", identity_pose(), variable={"q": 1.0}, inertia=BODY)
    b = Link("b", "a", "revolute", identity_pose(), variable={"q": -1.0})
    tool = Link("tool", "b", "fixed", identity_pose())
    return assemble("robot", [a, b, tool], q)


def test_arrays_of_a_model_cannot_be_written(model):
    for array in (model.coupling, model.offset, model.lower, *model.tree, model.frames["a"].pose.position):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_missing_inertia_is_refused_by_link_name_and_declaring_the_link_massless_completes_the_model(model):
    with pytest.raises(MissingInertiaError, match=r'robot "robot": no inertia for link.*"b"') as caught:
        model.require_inertia()
    assert caught.value.links == ("b",)
    declared = model.with_massless(["b", "tool"])
    declared.require_inertia()
    assert declared.massless == ("b",)
    assert model.missing_inertia == ("b",)  # the first one is as it was


@pytest.mark.parametrize(
    ("name", "said"),
    [("x", 'massless link "x" is not a link; links: a, b'), ("a", 'link "a" is named massless but has 1.5 kg')],
)
def test_only_links_without_mass_can_be_declared_massless(model, name, said):
    with pytest.raises(InputError, match=said):
        model.with_massless([name])


def test_the_tip_is_meant_where_no_frame_is_named_and_an_unknown_one_is_refused_with_those_there_are(model):
    assert model.frame() is model.frame("tool")
    with pytest.raises(InputError, match='no frame "x"; frames: a, b, base, tool'):
        model.frame("x")


def test_models_compare_and_hash_by_identity(model):
    assert model == model
    assert model != replace(model)
    assert len({model, model}) == 1


def test_a_model_travels_to_another_process(model):
    copy = pickle.loads(pickle.dumps(model))
    assert copy.joint_names == model.joint_names
    assert_array_equal(copy.tree.inertia, model.tree.inertia)


PLACE = np.array([0.1, -0.2, 0.3])


def test_no_payload_and_one_taken_off_leave_the_robot_as_it_was():
    assert RAVEN.with_payload("wrist", 0.0, PLACE) is RAVEN
    assert RAVEN.with_payload("wrist", 0.3, PLACE).without_payload is RAVEN


def test_a_payload_adds_its_own_potential_and_kinetic_energy(rng):
    heavy = RAVEN.with_payload("elbow", 0.4, PLACE)
    q, qd = rng.uniform(RAVEN.lower, RAVEN.upper), rng.normal(size=3)

    def place(at):
        pose = frame_pose(RAVEN, "elbow", at)
        return pose[:3, :3] @ PLACE + pose[:3, 3]

    velocity = (place(q + 1e-6 * qd) - place(q - 1e-6 * qd)) / 2e-6
    gravity = np.array([0.0, 0.0, -9.81])
    more = potential_energy(heavy, q, gravity) - potential_energy(RAVEN, q, gravity)
    assert_allclose(more, -0.4 * gravity @ place(q), atol=1e-12)
    moving = 0.5 * qd @ (mass_matrix(heavy, q) - mass_matrix(RAVEN, q)) @ qd
    assert_allclose(moving, 0.2 * velocity @ velocity, rtol=1e-7)  # central difference, h = 1e-6


def test_a_payload_of_some_extent_is_the_points_that_it_is_made_of(rng):
    points, shares = rng.normal(scale=0.1, size=(5, 3)), rng.uniform(0.1, 0.5, 5)
    center = shares @ points / shares.sum()
    tensor = sum(m * ((p - center) @ (p - center) * np.eye(3) - np.outer(p - center, p - center))
                 for m, p in zip(shares, points, strict=True))  # fmt: skip
    arm = load_robot("ur10e")
    whole = arm.with_payload("tool0", shares.sum(), center, inertia=tensor)
    six = arm.with_payload("tool0", shares.sum(), center, inertia=tensor[np.triu_indices(3)])
    pieces = arm
    for share, point in zip(shares, points, strict=True):
        pieces = pieces.with_payload("tool0", share, point)
    q = rng.normal(size=6)
    assert_allclose(mass_matrix(whole, q), mass_matrix(pieces, q), atol=1e-12)
    assert_array_equal(six.tree.inertia, whole.tree.inertia)


def test_an_inertia_that_no_payload_has_is_refused():
    with pytest.raises(InputError, match='payload on "wrist": inertia has principal moments'):
        RAVEN.with_payload("wrist", 1.0, PLACE, inertia=np.diag([0.1, 0.01, 0.01]))
    with pytest.raises(InputError, match="inertia must be symmetric"):
        RAVEN.with_payload("wrist", 1.0, PLACE, inertia=np.arange(9.0).reshape(3, 3))
    with pytest.raises(InputError, match="inertia: expected shape"):
        RAVEN.with_payload("wrist", 1.0, PLACE, inertia=[1.0, 2.0])


def test_a_payload_on_a_massless_link_gives_it_a_mass():
    model = load_robot("raven2_full")
    heavy = model.with_payload("tool", 0.2, [0.0, 0.0, 0.0])
    assert heavy.tree.mass.sum() == pytest.approx(model.tree.mass.sum() + 0.2)
    assert len(heavy.massless) == len(model.massless) - 1


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("raven2", ("nose", 1.0, PLACE), 'no frame "nose"'),
        ("raven2", ("base", 1.0, PLACE), "does not move"),
        ("raven2", ("wrist", -1.0, PLACE), "mass -1 kg, expected zero or more"),
        ("raven2", ("wrist", np.nan, PLACE), "mass is nan"),
        ("raven2", ("wrist", 1.0, [0.0, 0.0]), "position: expected shape (3,)"),
        ("dvrk_psm_motors", ("pitch", 1.0, PLACE), "no inertia for link"),
    ],
)
def test_a_payload_that_cannot_be_is_refused(name, arguments, said):
    with pytest.raises(CatenaryError) as caught:
        load_robot(name).with_payload(*arguments)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("mass", "place", "said"),
    [
        (5000.0, PLACE, "payload of 5000 kg on an arm of"),
        (0.2, [0.0, 0.0, 150.0], " m from the joint; positions are in m"),
    ],
)
def test_a_payload_that_is_hardly_meant_is_logged(mass, place, said, caplog):
    RAVEN.with_payload("wrist", mass, place)
    assert said in caplog.text


seeds = st.integers(0, 2**32 - 1)


def test_a_body_of_which_one_part_has_no_inertia_has_none():
    whole = LinkInertia(1.0, np.array([0.2, 0.0, 0.0]), np.eye(3))
    part = LinkInertia(3.0, np.array([0.0, 0.4, 0.0]), None)
    turned = Pose(rotation_from_rpy([0.1, 0.2, 0.3]), np.ones(3))
    for both in (whole.plus(part), part.plus(whole)):
        assert both.inertia is None
        assert both.mass == 4.0
        np.testing.assert_allclose(both.com, [0.05, 0.3, 0.0])
    assert part.moved(turned).inertia is None


@given(seeds)
def test_no_cloud_of_masses_has_an_inertia_that_no_body_has_whatever_digits_a_file_keeps(seed):
    body = inertia_of(*cloud(np.random.default_rng(seed)))
    rounded = np.array([float(f"{value:.7g}") for value in body.inertia.ravel()]).reshape(3, 3)
    assert unphysical(body.mass, rounded) is None
    rod = body.mass * np.diag([1.0, 1.0, -1e-20])  # of no width, but for rounding
    assert unphysical(body.mass, rod) is None


@given(seeds, st.floats(1e-3, 1.0))
def test_moments_that_are_negative_or_larger_than_the_sum_of_the_others_are_told(seed, beyond):
    rng = np.random.default_rng(seed)
    R = random_pose(rng).rotation
    a, b = rng.uniform(0.1, 1.0, 2)
    too_large = R @ np.diag([a, b, (a + b) * (1.0 + beyond)]) @ R.T
    negative = R @ np.diag([a, b, -beyond * min(a, b)]) @ R.T
    assert "larger than the sum" in unphysical(1.0, too_large)
    assert not is_negative(1.0, too_large)
    assert "negative principal moment" in unphysical(1.0, negative)
    assert is_negative(1.0, negative)
