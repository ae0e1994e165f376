from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.control.gravity_pd import EstimatedGravityPD
from catenary.control.loop import run_loop
from catenary.control.pd import JointPD
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.estimator import RecursiveGravityEstimator
from catenary.gravity.payload import Payload
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from oracles.hanging_plant import HangingPlant, Poses
from oracles.random_trees import random_robot

UPRIGHT = np.array([0.0, 0.0, -9.81])
KP, KD = np.full(3, 400.0), np.full(3, 40.0)
PLANAR = load_robot("planar_3r")
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
        JointPD(KP, KD),
        Poses(POSES, 2.5),
        observers=[estimator, lambda tick: seen.append((tick.time, estimator.s_hat))],
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
    run_loop(plant, EstimatedGravityPD(KP, KD, estimator), Poses(POSES[:6], 2.5), max_speed=np.inf)
    assert_allclose(plant.q, POSES[5], atol=1e-3)  # a PD alone sags by up to 0.06 rad
    assert np.abs(gravity_torque(LOADED, POSES[5], UPRIGHT) / KP).max() > 0.02


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
def test_wrong_options_are_refused_with_a_reason(options: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        RecursiveGravityEstimator(PLANAR, **{"noise": 0.05, **options})  # type: ignore[arg-type]
