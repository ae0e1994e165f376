"""The Puma 560 against the numbers that the Robotics Toolbox prints and tests for its `qn`, to their four decimals."""

import numpy as np
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import coriolis_matrix, mass_matrix
from catenary.dynamics.kinematics import forward_kinematics
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot

PUMA = load_robot("puma560")
LEVEL = np.array([0.0, 0.0, -9.81])
QN = np.array([0.0, np.pi / 4, np.pi, 0.0, np.pi / 4, 0.0])
# rotors and gears of the same survey, which the toolbox adds
GEARS = np.array([62.6111, 107.815, 53.7063, 76.0364, 71.923, 76.686])
ROTORS = np.diag(np.repeat([200e-6, 33e-6], 3) * GEARS**2)
PRINTED = 0.51e-4  # four decimals


def test_gravity_load_is_the_printed_one() -> None:
    assert_allclose(gravity_torque(PUMA, QN, LEVEL), [0.0, 31.6399, 6.0351, 0.0, 0.0283, 0.0], atol=PRINTED)
    other = gravity_torque(PUMA, np.arange(1.0, 7.0), LEVEL)
    assert_allclose(other, [0.0, -7.9683, 8.4581, -0.0197, 0.0027, 0.0], atol=PRINTED)


def test_inertia_with_the_rotors_is_the_printed_one() -> None:
    printed = np.array(
        [
            [3.6594, -0.4044, 0.1006, -0.0025, 0.0, 0.0],
            [-0.4044, 4.4137, 0.3509, 0.0, 0.0024, 0.0],
            [0.1006, 0.3509, 0.9378, 0.0, 0.0015, 0.0],
            [-0.0025, 0.0, 0.0, 0.1925, 0.0, 0.0],
            [0.0, 0.0024, 0.0015, 0.0, 0.1713, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.1941],
        ]
    )
    assert_allclose(mass_matrix(PUMA, QN) + ROTORS, printed, atol=PRINTED)


def test_coriolis_matrix_is_the_printed_one() -> None:
    printed = [
        [-0.1735, -2.0494, -0.1178, -0.0002, -0.0045, 0.0001],
        [0.6274, 1.1572, 1.9287, -0.0015, -0.0003, 0.0],
        [-0.3608, -0.7734, -0.0018, -0.0009, -0.0064, 0.0],
        [0.0011, 0.0005, -0.0001, 0.0002, 0.0002, -0.0001],
        [-0.0002, 0.0028, 0.0046, -0.0002, 0.0, 0.0],
        [0.0001, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
    assert_allclose(coriolis_matrix(PUMA, QN, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]), printed, atol=PRINTED)


def test_it_stands_as_the_closed_form_of_its_arm_says(rng: np.random.Generator) -> None:
    """The wrist's centre, by the geometry of shoulder, upper arm and forearm [Paul, Zhang 1986]."""
    for q in rng.uniform(PUMA.lower, PUMA.upper, size=(20, 6)):
        along = 0.4318 * np.cos(q[1]) + 0.0203 * np.cos(q[1] + q[2]) - 0.4318 * np.sin(q[1] + q[2])
        up = 0.4318 * np.sin(q[1]) + 0.0203 * np.sin(q[1] + q[2]) + 0.4318 * np.cos(q[1] + q[2])
        c, s = np.cos(q[0]), np.sin(q[0])
        wrist = forward_kinematics(PUMA, q, "joint4").position
        assert_allclose(wrist, [c * along + s * 0.15005, s * along - c * 0.15005, up], atol=1e-12)
