from dataclasses import replace

import numpy as np
import pytest

from catenary import MotionLog
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.robots.catalog import load_robot
from papers.calibration.peers import elastic_joints
from papers.calibration.peers.elastic_joints import (
    FIRST_SPREAD,
    GRAVITY,
    ROBOT,
    STEP,
    Drive,
    Joints,
    advance,
    derivatives,
    filtered,
    identified,
    run_filter,
)

EYE = np.diag([20.0, 20.0, 4.0])


def joints(friction: float = 0.0) -> Joints:
    stiffness = np.array([200.0, 300.0, 7e4])
    return Joints(
        stiffness,
        np.array([2.0, 2.0, 50.0]),
        np.array([0.26, 0.2, 65.0]),
        np.full(3, friction),
        np.full(3, friction),
        np.zeros(3),
        np.array([0.2, 0.2, 2.0]),
        np.array([1e-4, 1e-4, 1e-5]),
    )


def drive(rng: np.random.Generator, count: int) -> Drive:
    wave = np.sin(np.arange(count)[:, None] * [0.1, 0.13, 0.07])
    return Drive(
        time=0.005 * np.arange(count),
        position=0.02 * wave + 1e-4 * rng.normal(size=(count, 3)),
        torque=rng.normal(size=(count, 3)),
        bias=wave,
        inverse=np.tile(EYE, (count, 1, 1)),
    )


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the filter as plain Python: compiling it takes longer than all these tests."""
    monkeypatch.setattr(elastic_joints, "run_filter", run_filter.__wrapped__)


def test_without_friction_it_is_a_linear_kalman_filter() -> None:
    told, numbers = drive(np.random.default_rng(0), 40), joints()
    first = np.concatenate((told.position[0], told.position[0] - told.bias[0] / numbers.stiffness, np.zeros(6)))
    x, P = first, np.diag(np.full(12, FIRST_SPREAD**2))
    H, R = np.eye(3, 12), np.diag(numbers.encoder_noise**2)
    light = np.concatenate((1.0 / numbers.motor_inertia, np.diag(EYE)))
    most = np.tile(numbers.torque_noise, 2) * light * 0.005
    Q = np.diag(np.concatenate((0.5 * most * 0.005, most)) ** 2)
    states = []
    for row in range(40):
        if row:
            torque = 0.5 * (told.torque[row - 1] + told.torque[row])

            def through(start, torque=torque, bias=told.bias[row]):
                moved = start.copy()
                advance(moved, numbers, torque, bias, EYE, STEP, 5)
                return moved

            constant = through(np.zeros(12))
            F = np.column_stack([through(unit) - constant for unit in np.eye(12)])
            x, P = F @ x + constant, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (told.position[row] - H @ x), (np.eye(12) - K @ H) @ P
        states.append(x)
    # the encoder's update one by one and at once round differently
    np.testing.assert_allclose(filtered(told, numbers), states, atol=1e-7)


def test_a_load_that_is_held_stretches_the_cable_by_load_over_stiffness() -> None:
    numbers, load = joints(), np.array([2.0, 1.0, 5.0])
    x = np.zeros(12)
    for _ in range(400):
        x[6:] *= 0.9  # a hand that calms the motion
        advance(x, numbers, load, load, EYE, STEP, 20)
    np.testing.assert_allclose(x[:3] - x[3:6], load / numbers.stiffness, rtol=1e-3)


def test_friction_holds_what_pushes_less() -> None:
    x = np.zeros(12)
    advance(x, joints(friction=0.5), np.full(3, 0.4), np.zeros(3), EYE, STEP, 100)
    np.testing.assert_array_equal(x, 0.0)


def test_stiffness_and_offset_are_found_where_nothing_else_is_wrong() -> None:
    t = np.arange(0.0, 40.0, 1 / 30)
    q = np.array([0.7, 1.4, 0.38]) + np.column_stack((np.sin(t), np.cos(0.7 * t), np.sin(1.3 * t))) * [0.2, 0.2, 0.04]
    log = MotionLog(
        "motion", ("a", "b", "c"), ("rad", "rad", "m"), q, np.ones(len(t), dtype=bool), q, time=t, tau=np.zeros_like(q)
    )
    _, qd, qdd = derivatives(log)
    load = inverse_dynamics(load_robot(ROBOT), q, qd, qdd, GRAVITY)
    stiffness, offset = np.array([150.0, 400.0, 5e4]), np.array([0.02, -0.1, 0.01])
    found = identified([replace(log, q_encoder=q + offset - load / stiffness)])
    np.testing.assert_allclose(found.stiffness, stiffness, rtol=1e-3)  # to where the search ends
    np.testing.assert_allclose(found.offset, offset, rtol=1e-3)
