from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.dynamics.inverse_dynamics import inverse_dynamics, mass_matrix
from catenary.errors import InputError, MissingInertiaError, UnsupportedModelError
from catenary.gravity.torque import gravity_torque
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.link_inertia import LinkInertia
from catenary.spatial import LEVEL, Pose, identity_pose, rotation_from_rpy
from oracles.point_masses import assert_same_body, cloud, inertia_of
from oracles.random_robots import random_tensor
from oracles.random_trees import random_pose
from oracles.tree_poses import frame_pose

seeds = st.integers(0, 2**32 - 1)


def link(name="a", parent="base", joint="revolute", **options):
    if joint != "fixed":
        options.setdefault("variable", {"q": 1.0})
    options.setdefault("pose", identity_pose())
    return Link(name, parent, joint, **options)


Q = [Coordinate("q", "rad")]


@pytest.mark.parametrize("seed", range(3))
def test_a_chain_of_fixed_links_is_folded_into_the_link_that_carries_it(seed):
    rng = np.random.default_rng(seed)
    clouds = [cloud(rng) for _ in range(3)]
    joint, first, second = (random_pose(rng) for _ in range(3))
    frame = random_pose(rng)
    model = assemble(
        "r",
        [
            link("second", "first", "fixed", pose=second, inertia=inertia_of(*clouds[2])),
            link("a", pose=joint, frame=frame, inertia=inertia_of(*clouds[0])),
            link("first", "a", "fixed", pose=first, inertia=inertia_of(*clouds[1])),
        ],
        Q,
    )
    into_joint_frame = [frame, frame @ first, frame @ first @ second]
    places = [p @ T.rotation.T + T.position for (_, p), T in zip(clouds, into_joint_frame, strict=True)]
    expected = inertia_of(np.concatenate([m for m, _ in clouds]), np.concatenate(places))
    tree = model.tree
    assert_same_body(LinkInertia(tree.mass[0], tree.com[0], tree.inertia[0]), expected)
    assert model.link_names == ("a",)
    at_zero = joint @ frame @ first @ second
    assert_allclose(frame_pose(model, "second", [0.0])[:3, 3], at_zero.position, atol=1e-12)


def test_what_is_fixed_to_the_base_has_no_part_in_the_masses():
    heavy = LinkInertia(5.0, np.zeros(3), np.eye(3))
    model = assemble("r", [link("table", joint="fixed", inertia=heavy), link("a", "table", inertia=heavy)], Q)
    assert_array_equal(model.tree.mass, [5.0])


def test_links_come_depth_first_and_siblings_as_given():
    names = ("c", "b"), ("d", "base"), ("b", "a"), ("a", "base")
    model = assemble("r", [link(name, parent) for name, parent in names], Q)
    assert sorted(model.link_names) == ["a", "b", "c", "d"]
    for number, parent in enumerate(model.tree.parent):
        assert parent < number
    assert assemble("r", [link("x"), link("y"), link("z", "x")], Q).link_names == ("x", "z", "y")


def test_a_joint_may_move_with_several_coordinates_and_an_offset():
    rows = [link("a"), link("b", "a", variable={"q": 2.0, "s": -1.0}, offset=0.3)]
    model = assemble("r", rows, [Coordinate("s", "rad"), Coordinate("q", "rad")])
    assert_array_equal(model.coupling, [[0, 1], [-1, 2]])
    assert_array_equal(model.offset, [0, 0.3])


def test_a_joint_that_moves_with_no_coordinate_stands_at_its_offset():
    model = assemble("r", [link("a"), link("b", "a", variable={}, offset=np.pi / 2)], Q)
    assert_allclose(frame_pose(model, "b", [0.0])[:3, 0], [0, 1, 0], atol=1e-15)


def test_a_robot_of_constant_joints_only_has_no_coordinates():
    assert assemble("r", [link(variable={})], []).n == 0


def test_the_tip_is_the_end_of_the_longest_chain_unless_it_is_named():
    links = [link("a"), link("b", "a"), link("c", "base")]
    assert assemble("r", links, Q).tip == "b"
    assert assemble("r", links, Q, tip="c").tip == "c"


def test_frames_are_fixed_to_links_moving_fixed_or_the_base():
    up = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    links = [link("a", pose=up), link("f", "a", "fixed", pose=up)]
    model = assemble("r", links, Q, frames={"x": ("f", up), "y": ("base", up), "z": ("a", up)})
    heights = [frame_pose(model, name, [0.0])[2, 3] for name in ("x", "y", "z")]
    assert heights == [3, 1, 2]


def test_links_without_mass_are_missing_inertia_unless_they_are_declared_massless():
    zero = LinkInertia(0.0, np.zeros(3), np.zeros((3, 3)))
    links = [link("a"), link("b", inertia=zero), link("c", massless=True), link("d")]
    model = assemble("r", links, Q, massless=["d"])
    assert model.missing_inertia == ("a", "b")
    assert model.massless == ("c", "d")


NEGATIVE = np.diag([1.0, 1.0, -0.1])


def test_a_link_whose_inertia_no_body_has_holds_its_arm_and_is_refused_in_motion(caplog):
    sound = LinkInertia(2.0, np.array([0.3, 0.0, 0.1]), np.eye(3))
    for inertia in (NEGATIVE, None):
        model, as_it_should = (
            assemble("r", [link(axis=np.array([0.0, 1.0, 0.0]), inertia=replace(sound, inertia=tensor))], Q)
            for tensor in (inertia, sound.inertia)
        )
        assert_array_equal(gravity_torque(model, [0.4], LEVEL), gravity_torque(as_it_should, [0.4], LEVEL))
        for asked in (mass_matrix, lambda m, q: inverse_dynamics(m, q, q, q, LEVEL)):
            with pytest.raises(MissingInertiaError, match='"a" have a mass but no inertia that a body can have'):
                asked(model, [0.4])
        assert model.doubts[0] in caplog.text
        assert "masses and torques of motion are refused" in model.doubts[0]


def test_a_part_with_an_impossible_inertia_is_a_doubt_where_it_plays_no_part_or_little(caplog):
    base, arm = (LinkInertia(5.0, np.zeros(3), np.eye(3)) for _ in range(2))
    antenna = LinkInertia(0.01, np.zeros(3), -1e-4 * np.eye(3))
    crumb = LinkInertia(5e-4, np.zeros(3), np.diag([1.0, -1.0, 1.0]))
    links = [
        link("table", joint="fixed", inertia=replace(base, inertia=NEGATIVE)),
        link("a", "table", inertia=arm),
        link("antenna", "a", "fixed", inertia=antenna),
        link("b", "a", inertia=crumb),
    ]
    model = assemble("r", links, Q)
    assert mass_matrix(model, [0.0]).shape == (1, 1)
    effects = [doubt.rpartition(": ")[2] for doubt in model.doubts]
    assert effects == ["it is fixed to the base and plays no part", "taken as it is", "taken as it is"]
    assert len(caplog.records) == 1  # one line a robot


BODY = LinkInertia(1.0, np.zeros(3), np.eye(3))
NAN3 = np.array([0.0, np.nan, 0.0])


def body(**changes):
    return [link(inertia=replace(BODY, **changes))]


REFUSED = [
    ({"links": [link(), link()]}, 'two links are named "a"'),
    ({"links": [link("base")]}, 'a link is named "base"'),
    ({"links": [link(parent="x")]}, 'link "a" hangs on unknown link "x"; links: base, a'),
    ({"links": [link(variable={"x": 1.0})]}, 'link "a": moves with unknown coordinate "x"; coordinates: q'),
    ({"links": [link(variable={"q": np.nan})]}, 'link "a": factor of "q" is nan'),
    ({"links": [link(), link("f", joint="fixed", variable={"q": 1.0})]}, 'link "f": is fixed and moves with q'),
    ({"links": [link(joint="ball")]}, 'link "a": joint "ball", expected revolute or prismatic or fixed'),
    ({"links": [link(axis=np.zeros(3))]}, 'link "a": axis must not be zero'),
    ({"links": [link(axis=NAN3)]}, 'link "a": axis[1] is nan'),
    ({"links": [link(offset=np.inf)]}, 'link "a": offset is inf'),
    ({"links": [link(pose=Pose(np.eye(3), NAN3))]}, 'link "a": joint: origin[1] is nan'),
    ({"links": [link(pose=Pose(2 * np.eye(3), np.zeros(3)))]}, 'link "a": joint: rotation: expected a rotation'),
    ({"links": [link(frame=Pose(-np.eye(3), np.zeros(3)))]}, 'link "a": link frame: rotation: expected a rotation'),
    ({"links": body(mass=-1.0)}, 'link "a": mass -1.0 kg, expected a finite number, zero or more'),
    ({"links": body(mass=np.nan)}, 'link "a": mass nan kg'),
    ({"links": body(com=NAN3)}, 'link "a": centre of mass[1] is nan'),
    ({"links": body(com=np.zeros(2))}, "centre of mass: expected shape (3,), got (2,)"),
    ({"links": body(inertia=np.triu(np.ones((3, 3))))}, 'link "a": inertia must be symmetric'),
    ({"coordinates": [*Q, *Q]}, "coordinate names must differ, got q, q"),
    ({"coordinates": [*Q, Coordinate("s", "rad")]}, "coordinates s move no joint"),
    ({"coordinates": [Coordinate("q", "deg")]}, 'coordinate "q": unit "deg", expected "rad" or "m"'),
    ({"coordinates": [Coordinate("q", "rad", 1.0, 0.0)]}, 'coordinate "q": limits [1.0, 0.0]'),
    ({"coordinates": [Coordinate("q", "rad", np.nan, 0.0)]}, "limits [nan, 0.0]"),
    ({"coordinates": [Coordinate("q", "rad", effort=-1.0)]}, "effort limit -1.0: expected zero or more"),
    ({"frames": {"f": ("x", identity_pose())}}, 'frame "f" is fixed to unknown link "x"; links: base, a'),
    ({"frames": {"a": ("a", identity_pose())}}, 'frame "a" has the name of another frame or link'),
    ({"frames": {"f": ("a", Pose(np.ones((3, 3)), np.zeros(3)))}}, 'frame "f": rotation: expected'),
    ({"tip": "x"}, 'tip "x" is no frame; frames: base, a'),
    ({"massless": ["x"]}, 'massless link "x" is not a link; links: a'),
]  # fmt: skip


@pytest.mark.parametrize(("changed", "said"), REFUSED, ids=[said[-40:] for _, said in REFUSED])
def test_what_makes_no_robot_is_refused_by_robot_and_link(changed, said):
    with pytest.raises(InputError) as caught:
        assemble("r", **({"links": [link()], "coordinates": Q} | changed))
    assert said in str(caught.value)
    assert str(caught.value).startswith('robot "r": ')


@pytest.mark.parametrize(
    ("links", "said"),
    [
        ([], "no moving joint"),
        ([link(joint="fixed")], "no moving joint"),
        ([link(), link("b", "c"), link("c", "b")], "the parents of links b, c form a loop"),
    ],
)
def test_links_that_make_no_moving_tree_are_refused(links, said):
    with pytest.raises(UnsupportedModelError, match=f'robot "r": {said}'):
        assemble("r", links, Q if links[1:] else [])


def test_a_tensor_that_is_symmetric_but_for_rounding_is_accepted():
    tensor = random_tensor(np.random.default_rng(0))
    tensor[0, 1] *= 1.0 + 1e-9
    assemble("r", [link(inertia=LinkInertia(1.0, np.zeros(3), tensor))], Q)


def on(*axes):
    return tuple(axis in axes for axis in "xyz")


def test_axes_of_the_centre_of_mass_are_seen_from_the_joints_frame():
    # the link's frame lies 0.2 m along x of the joint's and is turned about x by a quarter: its y is the joint's z
    frame = Pose(rotation_from_rpy([np.pi / 2, 0.0, 0.0]), np.array([0.2, 0.0, 0.0]))
    model = assemble("r", [link(frame=frame, axes_of_com=on("y"))], Q)
    assert_array_equal(model.axes_of_com, [[True, False, True]])
    assert_array_equal(assemble("r", [link()], Q).axes_of_com, [[True, True, True]])


def test_a_fixed_link_with_mass_widens_the_axes_of_the_link_that_carries_it():
    body = LinkInertia(1.0, np.zeros(3), np.eye(3))
    beside = Pose(np.eye(3), np.array([0.0, 0.1, 0.0]))
    links = [link(axes_of_com=on("x")), link("b", "a", "fixed", pose=beside, axes_of_com=on("x"), inertia=body)]
    assert_array_equal(assemble("r", links, Q).axes_of_com, [[True, True, False]])
    without = [links[0], replace(links[1], inertia=None)]
    assert_array_equal(assemble("r", without, Q).axes_of_com, [[True, False, False]])


def test_a_centre_of_mass_off_its_declared_axes_is_refused():
    body = LinkInertia(1.0, np.array([0.1, 0.0, 0.2]), np.eye(3))
    with pytest.raises(InputError, match=r'link "a": centre of mass has z = 0\.2 m, and its axes are declared to be x'):
        assemble("r", [link(inertia=body, axes_of_com=on("x"))], Q)
