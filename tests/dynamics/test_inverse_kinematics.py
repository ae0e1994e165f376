import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, UnreachablePoseError
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.spatial import Pose

PLANAR, PANDA = load_robot("planar_3r"), load_robot("panda")

FAR = Pose(np.eye(3), np.array([5.0, 0.0, 0.0]))


@pytest.mark.parametrize("name", ["ur10e", "panda", "iiwa14"])
def test_poses_of_an_arm_are_reached_within_its_limits(name: str, rng: np.random.Generator) -> None:
    model = load_robot(name)
    for _ in range(20):
        pose = forward_kinematics(model, rng.uniform(model.lower, model.upper))
        q = inverse_kinematics(model, pose.matrix, rng=rng, starts=100)
        assert (q >= model.lower).all()
        assert (q <= model.upper).all()
        again = forward_kinematics(model, q)
        assert_allclose(again.position, pose.position, atol=1.1e-7)  # the tolerance of the search
        assert_allclose(again.rotation, pose.rotation, atol=1.1e-7)


@pytest.mark.parametrize("name", ["gen3", "two_link"])
def test_joints_without_limits_are_searched_from_any_turn(name: str, rng: np.random.Generator) -> None:
    model = load_robot(name)
    turns = np.isinf(model.upper)
    assert turns.any()
    for _ in range(10):
        q = np.where(turns, rng.uniform(-np.pi, np.pi, model.n), rng.uniform(-1.0, 1.0, model.n))
        pose = forward_kinematics(model, q)
        found = inverse_kinematics(model, pose, rng=rng, starts=100)
        assert_allclose(forward_kinematics(model, found).position, pose.position, atol=1.1e-7)
        start = q + np.where(turns, 20 * np.pi, 0.0)  # ten turns on: the nearest solution is there
        assert_allclose(inverse_kinematics(model, pose, start), start, atol=1e-6)


def test_targets_at_the_limits_are_reached_from_near_them(rng: np.random.Generator) -> None:
    model = PANDA
    reached = 0
    for _ in range(50):
        q = rng.uniform(model.lower, model.upper)
        limit = np.where(rng.random(7) < 0.5, model.lower, model.upper)
        q = np.where(rng.random(7) < 0.4, limit, q)
        start = np.clip(q + 0.4 * rng.normal(size=7), model.lower, model.upper)
        try:
            inverse_kinematics(model, forward_kinematics(model, q), start)
        except UnreachablePoseError:
            continue
        reached += 1
    assert reached >= 45  # a step pressed against the limits, instead of along them, reaches some 35


def test_tolerances_are_met_as_asked(rng: np.random.Generator) -> None:
    model, start = PANDA, 0.5 * (PANDA.lower + PANDA.upper)
    target = forward_kinematics(model, start + rng.uniform(-0.5, 0.5, size=7))
    q = inverse_kinematics(model, target, start, position_tolerance=1e-12, orientation_tolerance=1e-12, rng=rng)
    assert_allclose(forward_kinematics(model, q).position, target.position, atol=1e-11)


def test_fewer_than_six_joints_match_the_position_alone(rng: np.random.Generator) -> None:
    for _ in range(20):
        target = forward_kinematics(PLANAR, rng.uniform(-2.0, 2.0, size=3)).position
        q = inverse_kinematics(PLANAR, Pose(np.eye(3), target), rng.uniform(-1.0, 1.0, size=3), rng=rng)
        assert_allclose(forward_kinematics(PLANAR, q).position, target, atol=1.1e-7)


def test_fewer_than_six_joints_match_a_pose_when_asked(rng: np.random.Generator) -> None:
    target = forward_kinematics(PLANAR, [0.4, 0.5, -0.3])
    q = inverse_kinematics(PLANAR, target, [0.3, 0.3, 0.3], match="pose", rng=rng)
    assert_allclose(forward_kinematics(PLANAR, q).rotation, target.rotation, atol=1.1e-7)


@pytest.mark.parametrize("name", ["raven2", "raven2_full"])
def test_search_finds_what_the_closed_form_does_not_offer(name: str) -> None:
    model = load_robot(name)
    q = np.array([0.5, 1.5, 0.4, 0.1, 0.3, 0.2])[: model.n]
    target = forward_kinematics(model, q, "insertion").position
    found = inverse_kinematics(model, Pose(np.eye(3), target), frame="insertion", match="position")
    assert_allclose(found[:3], q[:3], atol=1e-5)  # 1e-7 m at the lever of 0.4 m


def test_an_unreachable_target_says_how_near_the_search_came() -> None:
    # the arm is 0.9 m long
    with pytest.raises(UnreachablePoseError, match=r"nearest 4\.1 m away after 1 start.*pass rng"):
        inverse_kinematics(PLANAR, FAR, [0.1, 0.1, 0.1])
    with pytest.raises(UnreachablePoseError, match=r"nearest .* m and .* rad away after 6 start"):
        inverse_kinematics(load_robot("ur10e"), FAR, rng=np.random.default_rng(7), starts=5)


def test_an_unreachable_target_names_the_limits_that_hold_the_arm_back() -> None:
    model = assemble(
        "slide",
        [Link("carriage", "base", "prismatic", Pose(np.eye(3), np.zeros(3)), variable={"carriage": 1.0})],
        [Coordinate("carriage", "m", 0.0, 0.5)],
    )
    target = Pose(np.eye(3), np.array([0.0, 0.0, 0.7]))
    with pytest.raises(UnreachablePoseError, match=r'nearest 0\.2 m .*joint "carriage" at 0\.5 m'):
        inverse_kinematics(model, target)


def test_random_starts_come_from_the_generator_alone() -> None:
    model = PANDA
    target = forward_kinematics(model, 0.4 * (PANDA.lower + PANDA.upper))
    first, second = (inverse_kinematics(model, target, rng=np.random.default_rng(9), starts=30) for _ in range(2))
    assert_allclose(first, second, atol=0.0)


def test_wrong_arguments_are_refused_with_a_reason() -> None:
    with pytest.raises(InputError, match=r"q_start: expected shape \(3,\)"):
        inverse_kinematics(PLANAR, FAR, [0.0, 0.0])
    with pytest.raises(InputError, match=r"q_start\[1\] is nan"):
        inverse_kinematics(PLANAR, FAR, [0.0, np.nan, 0.0])
    with pytest.raises(InputError, match='no frame "foot"'):
        inverse_kinematics(PLANAR, FAR, frame="foot")
    with pytest.raises(InputError, match=r'match: expected "pose" or "position", got .both.'):
        inverse_kinematics(PLANAR, FAR, match="both")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"position_tolerance: expected more than 0, got 0\.0"):
        inverse_kinematics(PLANAR, FAR, position_tolerance=0.0)
