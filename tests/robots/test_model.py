import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError, MissingInertiaError
from catenary.robots.assembly import Coordinate, Link, LinkInertia, assemble
from catenary.spatial import identity_pose

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


def test_a_model_has_as_many_coordinates_as_names(model):
    assert model.n == 1


def test_missing_inertia_is_refused_by_link_name(model):
    with pytest.raises(MissingInertiaError, match=r'robot "robot": no inertia for link.*"b"') as caught:
        model.require_inertia()
    assert caught.value.links == ("b",)


def test_declaring_a_link_massless_completes_the_model(model):
    declared = model.with_massless(["b", "tool"])
    declared.require_inertia()
    assert declared.massless == ("b",)
    assert model.missing_inertia == ("b",)  # the first one is as it was


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("x", 'massless link "x" is not a link; links: a, b'),
        ("a", 'link "a" is named massless but has 1.5 kg'),
    ],
)
def test_only_links_without_mass_can_be_declared_massless(model, name, said):
    with pytest.raises(InputError, match=said):
        model.with_massless([name])


def test_the_tip_is_the_frame_that_is_meant_when_none_is_named(model):
    assert model.frame() is model.frame("tool")


def test_an_unknown_frame_is_refused_with_those_there_are(model):
    with pytest.raises(InputError, match='no frame "x"; frames: a, b, base, tool'):
        model.frame("x")


def test_a_renamed_robot_is_the_same_but_for_its_name(model):
    other = model.renamed("other")
    assert other.name == "other"
    assert_array_equal(other.tree.mass, model.tree.mass)


def test_models_compare_and_hash_by_identity(model):
    assert model == model
    assert model != model.renamed("robot")
    assert len({model, model}) == 1


def test_a_model_travels_to_another_process(model):
    copy = pickle.loads(pickle.dumps(model))
    assert copy.joint_names == model.joint_names
    assert_array_equal(copy.tree.inertia, model.tree.inertia)
