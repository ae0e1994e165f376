from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.control.loop import run_loop
from catenary.control.pd import EstimatedGravityPD, JointPD
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.estimator import GravityEstimator, RecursiveGravityEstimator
from catenary.gravity.gravity_regressor import gravity_parameters, gravity_regressor
from catenary.gravity.payload import Payload
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from oracles.hanging_plant import HangingPlant, Poses
from oracles.random_trees import random_robot

PLANAR = load_robot("planar_3r")

UPRIGHT = np.array([0.0, 0.0, -9.81])
KP, KD = np.full(3, 100.0), np.full(3, 20.0)  # critically damped on unit inertia
POSE = np.array([0.3, -0.5, 0.7])
ARMS = {"planar_3r": POSE, "raven2": np.array([0.5, 1.2, 0.4])}


def with_load(model: RobotModel, mass: float) -> RobotModel:
    masses = model.tree.mass.copy()
    masses[-1] += mass
    return replace(model, tree=model.tree._replace(mass=masses))


def test_estimate_changes_by_the_papers_law(rng: np.random.Generator) -> None:
    for seed in (3, 8, 11, 17):
        model = random_robot(seed).model
        n = model.n
        regressor = compact_regressor(model)
        p = len(regressor.labels)
        q, q_desired, gravity = rng.normal(size=n), rng.normal(size=n), rng.normal(size=3)
        qd = 0.01 * rng.normal(size=n)
        kp, kd = rng.uniform(1.0, 9.0, size=(2, n))
        root = rng.normal(size=(n, n))
        omega, s0 = root @ root.T + np.eye(n), rng.normal(size=p)
        estimator = GravityEstimator(model, kp, kd, omega=omega, s0=s0, damping=1e-12, max_speed=1.0)
        torque = estimator.update(q, qd, q_desired, gravity, 0.01)
        Z = regressor.Z(q, gravity)
        # the pseudo-inverse cuts off where the damping fades out
        rate = np.linalg.pinv(Z, rcond=1e-7) @ omega @ (kp * (q_desired - q) - kd * qd)
        assert_allclose(estimator.s_hat, s0 + 0.01 * rate, rtol=1e-4, atol=1e-6, err_msg=model.name)
        assert_allclose(torque, Z @ estimator.s_hat, atol=1e-12)
        assert_allclose(estimator.torque(q, gravity), torque, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "scale", "gravity"),
    [
        *((name, scale, UPRIGHT) for name in ARMS for scale in (0.0, -2.0)),
        ("raven2", 0.0, np.array([3.0, -4.0, -8.3])),  # a tilted base
    ],
)
def test_controller_learns_to_hold_the_arm_from_any_start(name: str, scale: float, gravity: Floats) -> None:
    model, q = load_robot(name), ARMS[name]
    s = compact_regressor(model).parameters()
    estimator = GravityEstimator(model, KP, KD, s0=scale * s)
    plant = HangingPlant(model, q, gravity)
    run_loop(plant, EstimatedGravityPD(KP, KD, estimator), Poses(q[None], 9.0), max_speed=np.inf)
    held = gravity_torque(model, q, gravity)
    # at Omega = 2 / s, e^-18 of at most 60 Nm would be left; an arm that first falls learns later
    assert_allclose(estimator.torque(plant.q, gravity), held, atol=2e-3)
    assert_allclose(plant.q, q, atol=1e-4)
    if name == "planar_3r":  # Z is square there: the pose that holds the arm gives the parameters themselves
        assert_allclose(estimator.s_hat, s, atol=1e-3)


def test_a_payload_picked_up_on_the_way_is_learnt() -> None:
    loaded = with_load(PLANAR, 0.8)
    estimator = GravityEstimator(PLANAR, KP, KD, s0=compact_regressor(PLANAR).parameters())
    plant = HangingPlant(PLANAR, POSE, UPRIGHT, loaded=loaded, pick_up=1.0)
    run_loop(plant, EstimatedGravityPD(KP, KD, estimator), Poses(POSE[None], 8.0), max_speed=np.inf)
    assert_allclose(estimator.torque(POSE, UPRIGHT), gravity_torque(loaded, POSE, UPRIGHT), atol=2e-3)


def test_observer_and_controller_follow_the_same_law() -> None:
    inside, beside = GravityEstimator(PLANAR, KP, KD), GravityEstimator(PLANAR, KP, KD)
    plant = HangingPlant(PLANAR, POSE, UPRIGHT)
    run_loop(plant, EstimatedGravityPD(KP, KD, inside), Poses(POSE[None], 4.0), observers=[beside], max_speed=np.inf)
    # they differ in when a tick's torque counts, the controller's already containing it
    assert_allclose(beside.s_hat, inside.s_hat, atol=5e-3)


def test_a_moving_arm_or_a_missing_number_leaves_the_estimate_alone() -> None:
    estimator = GravityEstimator(PLANAR, KP, KD, max_speed=[0.1, 0.1, 0.5])
    rest, off = np.zeros(3), np.full(3, 0.1)

    def learnt(q: Floats, qd: Floats, q_desired: Floats, gravity: Floats, dt: float) -> bool:
        before = estimator.s_hat
        estimator.update(q, qd, q_desired, gravity, dt)
        return bool((estimator.s_hat != before).any())

    assert learnt(rest, np.array([0.0, 0.0, 0.3]), off, UPRIGHT, 0.01)
    assert not learnt(rest, np.array([0.0, 0.3, 0.0]), off, UPRIGHT, 0.01)
    nan = np.array([0.0, np.nan, 0.0])
    for values in (
        (nan, rest, off, UPRIGHT),
        (rest, nan, off, UPRIGHT),
        (rest, rest, nan, UPRIGHT),
        (rest, rest, off, nan),
    ):
        assert not learnt(*values, 0.01)
    assert not learnt(rest, rest, off, UPRIGHT, 0.0)
    for dt in (-0.01, np.nan):
        with pytest.raises(InputError, match="dt: expected a time of zero or more"):
            estimator.update(rest, rest, off, UPRIGHT, dt)
    assert not learnt(rest, rest, off, np.zeros(3), 0.01)  # weightless
    assert np.isfinite(estimator.s_hat).all()


def test_time_that_stands_leaps_or_turns_back_teaches_nothing() -> None:
    estimator = GravityEstimator(load_robot("planar_3r"), KP, KD)
    before = estimator.s_hat
    for time in (5.0, 5.0, 9.0, 3.0):
        estimator.follow(JointState(time, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(0), UPRIGHT, 0.0), np.ones(3))
        assert_array_equal(estimator.s_hat, before)


def test_near_a_singular_pose_parameters_stay_bounded() -> None:
    # the last link upright bears no torque: the pseudo-inverse would divide by its cosine
    estimator = GravityEstimator(PLANAR, KP, KD)
    q = np.array([0.3, -0.5, 0.2 + np.pi / 2 + 1e-6])
    for _ in range(1000):
        estimator.update(q, np.zeros(3), q + 0.01, UPRIGHT, 0.001)
    assert np.abs(estimator.s_hat).max() < 20.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kp": [1.0, 2.0]}, r"kp: expected shape \(3,\), got \(2,\)"),
        ({"kp": [1.0, -2.0, 1.0]}, r"kp: expected zero or more"),
        ({"omega": [1.0, 2.0]}, r"omega: expected shape \(3,\), got \(2,\)"),
        ({"omega": -1.0}, "omega: expected a symmetric positive definite matrix"),
        ({"omega": [[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "omega: expected a symmetric"),
        ({"s0": [1.0]}, r"s0: expected shape \(3,\), got \(1,\)"),
        ({"s0": [1.0, np.nan, 1.0]}, r"s0\[1\] \(l2 m3 \+ lg2 m2\) is nan"),
        ({"max_speed": 0.0}, "max_speed: expected more than 0"),
        ({"damping": 0.0}, "damping: expected a positive number, got 0"),
    ],
)
def test_wrong_options_are_refused_with_a_reason(options: dict[str, object], said: str) -> None:
    arguments = {"kp": KP, "kd": KD, **options}
    with pytest.raises(InputError, match=said):
        GravityEstimator(load_robot("planar_3r"), **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("estimator", [GravityEstimator(PLANAR, KP, KD), RecursiveGravityEstimator(PLANAR, noise=0.05)])
def test_a_robot_of_another_size_is_refused(estimator) -> None:
    with pytest.raises(InputError, match="is for 3 joints, the robot has 2"):
        estimator.update(np.zeros(2), np.zeros(2), np.zeros(2), UPRIGHT, 0.01)


def test_a_robot_without_mass_is_refused() -> None:
    arm = load_robot("two_link")
    weightless = replace(arm, massless=arm.link_names, tree=arm.tree._replace(mass=np.zeros(2), com=np.zeros((2, 3))))
    with pytest.raises(InputError, match="no parameter has an effect"):
        GravityEstimator(weightless, [1.0, 1.0], [1.0, 1.0])


@pytest.mark.parametrize("name", ARMS)
def test_full_form_follows_the_law_with_parameters_of_every_joint_by_itself(
    name: str, rng: np.random.Generator
) -> None:
    model = load_robot(name)
    q, q_desired, gravity = ARMS[name], ARMS[name] + 0.1 * rng.normal(size=3), rng.normal(size=3)
    s0 = rng.normal(size=len(gravity_parameters(model).values))
    estimator = GravityEstimator(model, KP, KD, s0=s0, damping=1e-12, form="full")
    assert estimator.labels == gravity_parameters(model).labels
    torque = estimator.update(q, np.zeros(3), q_desired, gravity, 0.01)
    Z = gravity_regressor(model, q, gravity)
    rate = 2.0 * np.linalg.pinv(Z) @ (KP * (q_desired - q))
    assert_allclose(estimator.s_hat, s0 + 0.01 * rate, rtol=1e-6, atol=1e-9)
    assert_allclose(torque, Z @ estimator.s_hat, atol=1e-12)


def test_in_the_full_form_a_joint_learns_by_itself_and_in_the_compact_one_it_does_not() -> None:
    off = np.array([0.0, 0.0, 0.1])
    changes = []
    for form in ("full", "compact"):
        estimator = GravityEstimator(PLANAR, KP, KD, form=form)
        estimator.update(POSE, np.zeros(3), POSE + off, UPRIGHT, 0.01)
        elsewhere = estimator.torque(np.add(POSE, [0.0, 0.8, 0.0]), UPRIGHT)
        changes.append(np.abs(elsewhere[:2]).max() / np.abs(elsewhere[2]))
    assert changes[0] < 1e-12
    assert changes[1] > 0.01


STIFF_KP, STIFF_KD = np.full(3, 400.0), np.full(3, 40.0)
LOADED = replace(PLANAR, tree=PLANAR.tree._replace(mass=np.array([2.0, 1.5, 1.8])))
POSES = np.random.default_rng(0).uniform(-1.2, 1.2, size=(12, 3))


def torques(model, q, gravity, rng, noise):
    return gravity_torque(model, q, gravity) + noise * rng.normal(size=model.n)


def eager(model, **options):
    """An estimator that takes every torque."""
    return RecursiveGravityEstimator(model, settle=0.0, interval=0.0, novelty=0.0, **{"noise": 0.05, **options})


def test_without_forgetting_it_is_weighted_least_squares_with_the_prior(rng: np.random.Generator) -> None:
    for seed in (4, 7, 12):
        model = random_robot(seed).model
        regressor = compact_regressor(model)
        p = len(regressor.labels)
        noise = rng.uniform(0.5, 2.0, model.n)
        spread, s0 = rng.uniform(0.5, 2.0, p), rng.normal(size=p)
        estimator = eager(model, noise=noise, s0=s0, spread=spread, forgetting=1.0)
        rows, wanted = [np.diag(1.0 / spread)], [s0 / spread]
        for k in range(30):
            q, gravity = rng.normal(size=model.n), rng.normal(size=3)
            tau = torques(model, q, gravity, rng, noise)
            assert estimator.update(q, np.zeros(model.n), tau, gravity, float(k))
            rows.append(regressor.Z(q, gravity) / noise[:, None])
            wanted.append(tau / noise)
        expected = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=None)[0]
        assert_allclose(estimator.s_hat, expected, atol=1e-8)
        covariance = np.linalg.inv(np.vstack(rows).T @ np.vstack(rows))
        assert_allclose(estimator.standard_deviations, np.sqrt(np.diag(covariance)), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("start", [None, [5.0, -1.0, 2.0]])
def test_poses_and_a_payload_are_learnt_beside_a_pd(start: list[float] | None) -> None:
    estimator = RecursiveGravityEstimator(PLANAR, noise=0.05, s0=start)
    seen = []
    plant = HangingPlant(PLANAR, POSES[0], UPRIGHT, loaded=LOADED, pick_up=15.0)
    run_loop(
        plant,
        JointPD(STIFF_KP, STIFF_KD),
        Poses(POSES, 2.5),
        observers=[estimator, lambda tick: seen.append((tick.time, estimator.s_hat))],
        max_speed=5.0,
    )
    before = next(s for time, s in seen if time >= 14.9)
    s, heavier = (compact_regressor(model).parameters() for model in (PLANAR, LOADED))
    # arms that count as resting still move at up to 0.02 rad/s: 0.4 Nm of damping, 0.03 of 9.81 times a parameter
    assert_allclose(before, s, atol=0.03)
    assert_allclose(estimator.s_hat, heavier, atol=0.03)
    assert 20 < estimator.taken < 400


def test_controller_with_it_holds_the_arm_after_a_payload() -> None:
    estimator = RecursiveGravityEstimator(PLANAR, noise=0.05)
    plant = HangingPlant(PLANAR, POSES[0], UPRIGHT, loaded=LOADED, pick_up=5.0)
    run_loop(plant, EstimatedGravityPD(STIFF_KP, STIFF_KD, estimator), Poses(POSES[:6], 2.5), max_speed=np.inf)
    assert_allclose(plant.q, POSES[5], atol=1e-3)  # a PD alone sags by up to 0.06 rad
    assert np.abs(gravity_torque(LOADED, POSES[5], UPRIGHT) / STIFF_KP).max() > 0.02


def test_a_load_on_a_known_carrier_is_told_in_its_first_pose(rng: np.random.Generator) -> None:
    model = load_robot("dual_arm_19")
    middle, half = 0.5 * (model.lower + model.upper), 0.3 * (model.upper - model.lower)
    rest = np.zeros(model.n)
    loaded = Payload(2.0, "right_hand", (0.03, 0.0, -0.02)).on(model)
    off = {}
    for carriers in ((), ("left_hand", "right_hand")):
        estimator = eager(model, carriers=carriers)
        for k, q in enumerate(middle + half * rng.uniform(-1.0, 1.0, size=(40, model.n))):
            estimator.update(q, rest, gravity_torque(model, q, UPRIGHT), UPRIGHT, float(k))
        estimator.update(middle, rest, gravity_torque(loaded, middle, UPRIGHT), UPRIGHT, 50.0)
        others = middle + half * rng.uniform(-1.0, 1.0, size=(40, model.n))
        held = gravity_torque(loaded, others, np.tile(UPRIGHT, (40, 1)))
        off[carriers] = max(
            np.abs(estimator.torque(q, UPRIGHT) - tau).max() for q, tau in zip(others, held, strict=True)
        )
    # one torque tells the 4 numbers of the load, by joints that 0.05 Nm of noise is assumed of
    assert off["left_hand", "right_hand"] < 0.3
    assert off[()] > 5.0  # of some 17 Nm


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
@pytest.mark.parametrize("spread", [10.0, 1e-2, 1e-5])
def test_certainty_of_an_arm_does_not_hold_its_load(spread: float, forgetting: float, rng: np.random.Generator) -> None:
    model = load_robot("dual_arm_19")
    loaded = Payload(2.0, "right_hand", (0.03, 0.0, -0.02)).on(model)
    middle, half = 0.5 * (model.lower + model.upper), 0.3 * (model.upper - model.lower)
    known, hands = compact_regressor(model).parameters(), ("left_hand", "right_hand")
    estimator = eager(model, s0=known, spread=spread, forgetting=forgetting, carriers=hands)
    turns = rng.uniform(-1.0, 1.0, size=(80, model.n))
    turns[20:30] = turns[20]  # the load is taken up where a few poses alike tell little of it
    for k, q in enumerate(middle + half * turns):
        tau = torques(model if k < 20 else loaded, q, UPRIGHT, rng, 0.05)
        estimator.update(q, np.zeros(model.n), tau, UPRIGHT, float(k))
    held = [gravity_torque(loaded, q, UPRIGHT) - estimator.torque(q, UPRIGHT) for q in middle + half * turns]
    assert np.sqrt(np.mean(np.square(held))) < 0.1  # of some 17 Nm; twice the noise


def test_an_arm_that_is_not_yet_known_is_not_taken_for_a_load() -> None:
    model = load_robot("dual_arm_19")
    q = 0.5 * (model.lower + model.upper)
    held = gravity_torque(model, q, UPRIGHT)
    estimates = []
    for carriers in ((), ("left_hand", "right_hand")):
        estimator = RecursiveGravityEstimator(model, noise=0.05, settle=0.0, carriers=carriers)
        assert estimator.update(q, np.zeros(model.n), held, UPRIGHT, 0.0)
        estimates.append(estimator.s_hat)
    assert_array_equal(*estimates)


def test_an_arm_at_rest_for_long_forgets_nothing() -> None:
    estimator = RecursiveGravityEstimator(PLANAR, noise=0.05)
    for k, pose in enumerate(POSES):
        for tick in range(400):
            time = k + tick / 400.0
            estimator.update(pose, np.zeros(3), gravity_torque(PLANAR, pose, UPRIGHT), UPRIGHT, time)
    taken, deviations = estimator.taken, estimator.standard_deviations
    held = gravity_torque(PLANAR, POSES[-1], UPRIGHT)
    for tick in range(5000):
        estimator.update(POSES[-1], np.zeros(3), held, UPRIGHT, 20.0 + tick / 25.0)
    assert estimator.taken == taken
    assert_array_equal(estimator.standard_deviations, deviations)
    assert_allclose(estimator.s_hat, compact_regressor(PLANAR).parameters(), atol=1e-4)


def test_only_quasi_static_ticks_away_from_the_stops_are_taken() -> None:
    model = load_robot("raven2")
    middle, rest = 0.5 * (model.lower + model.upper), np.zeros(3)
    tau = np.ones(3)

    def takes(q=middle, qd=rest, tau=tau, gravity=UPRIGHT) -> bool:
        estimator = RecursiveGravityEstimator(model, noise=0.05, margin=np.array([0.02, 0.02, 0.002]))
        first = estimator.update(q, qd, tau, gravity, 0.0)
        later = estimator.update(q, qd, tau, gravity, 0.3)
        assert not first  # it has not rested yet
        assert np.isfinite(estimator.s_hat).all()
        return later

    assert takes()
    assert not takes(qd=np.array([0.0, 0.03, 0.0]))
    assert not takes(q=model.upper - np.array([0.5, 0.01, 0.1]))
    assert not takes(q=model.lower + np.array([0.5, 0.5, 0.001]))
    for name in ("q", "qd", "tau", "gravity"):
        assert not takes(**{name: np.array([0.1, np.nan, 0.3])})
    assert not takes(tau=np.array([0.0, np.inf, 0.0]))


def test_moving_in_between_asks_for_rest_again() -> None:
    estimator = RecursiveGravityEstimator(PLANAR, noise=0.05, settle=0.2)
    rest, tau = np.zeros(3), np.ones(3)
    taken = [
        estimator.update(rest, speed * np.ones(3), tau, UPRIGHT, time)
        for time, speed in ((0.0, 0.0), (0.15, 1.0), (0.25, 0.0), (0.4, 0.0), (0.46, 0.0), (0.465, 0.0))
    ]
    assert taken == [False, False, False, False, True, False]  # the last one comes within the interval


def test_state_gives_time_torque_and_gravity() -> None:
    estimator = RecursiveGravityEstimator(PLANAR, noise=0.05, settle=0.0)
    held = gravity_torque(PLANAR, POSES[0], UPRIGHT)
    state = JointState(1.0, POSES[0], np.zeros(3), held, np.zeros(0), UPRIGHT, 0.0)
    assert_allclose(estimator.follow(state, POSES[0]), held, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"noise": 0.0}, "noise: expected more than 0"),
        ({"noise": [1.0, 2.0]}, r"noise: expected shape \(3,\)"),
        ({"spread": -1.0}, "spread: expected more than 0"),
        ({"s0": [1.0]}, r"s0: expected shape \(3,\)"),
        ({"load": (0.0, 0.3)}, "load: expected more than 0"),
        ({"carriers": ("claw",)}, 'frame "claw"|claw'),
        ({"spread": 1e-9}, "spread: expected at least 1e-06 kg m, kg, got 1e-09"),
        ({"forgetting": 0.0}, "forgetting: expected more than 0 and at most 1, got 0"),
        ({"forgetting": 1.1}, "forgetting: expected more than 0 and at most 1, got 1.1"),
        ({"settle": -1.0}, "settle: expected zero or more"),
        ({"interval": np.nan}, "interval is nan"),
        ({"max_speed": [1.0]}, r"max_speed: expected shape \(3,\)"),
        ({"margin": [np.nan] * 3}, r"margin\[0\] is nan"),
    ],
)
def test_wrong_options_of_the_recursive_one_are_refused_with_a_reason(options: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        RecursiveGravityEstimator(PLANAR, **{"noise": 0.05, **options})  # type: ignore[arg-type]
