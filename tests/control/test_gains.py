import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.control import gains
from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.firmware import joint_torques
from catenary.transmission.cable_elasticity import winding_of

NOMINAL = load_cable_arm()
FIRMWARE = NOMINAL.firmware
# units and joint limits of three joints, the last one without
BOX = ("rad", "m", "rad"), np.array([0.0, 0.2, -np.inf]), np.array([1.5, 0.5, np.inf])


def test_ravens_gains_and_torques_at_the_joints_are_those_of_the_mechanism_page() -> None:
    f = FIRMWARE
    kp, kd = gains.gains_at_joints(f.kp[:6], f.kd[:6], f.ratio[:6], f.gearbox[:6])
    assert_allclose(kp, [454.3, 361.7, 57_055.0, 0.7053, 1.0884, 1.0884], rtol=2e-4)  # four digits
    assert_allclose(kd, [12.11, 9.644, 4564.0, 0.00784, 0.0, 0.0], rtol=1e-3)
    most = gains.torque_at_joints(f.dac_limit, f.dac_per_ampere, f.torque_constant, f.ratio)
    # the last jaw is never checked
    assert_allclose(most, [7.521, 6.710, 95.36, 0.1595, 0.2658, 0.3366, np.inf], rtol=1e-3)


def test_gains_give_the_torque_of_the_firmware_where_cables_are_not_coupled() -> None:
    firmware = FIRMWARE.replace(coupling=np.zeros(3))
    kp, _ = gains.gains_at_joints(firmware.kp, firmware.kd, firmware.ratio, firmware.gearbox)
    error = np.array([0.01, -0.02, 0.001, 0.1, 0.0, 0.0, 0.0])
    asked = firmware.kp * firmware.ratio * error
    assert_allclose(joint_torques(firmware, asked), kp * error, rtol=1e-12)


def test_motors_add_the_kinetic_energy_of_their_turning() -> None:
    qd = np.random.default_rng(1).normal(size=3) * [1.0, 1.0, 0.1]
    motor = FIRMWARE.ratio[:3] * winding_of(FIRMWARE.coupling, qd)
    J = NOMINAL.cable.rotor_inertia
    inertia = gains.reflected_inertia(J, FIRMWARE.ratio[:3], FIRMWARE.coupling)
    assert_allclose(qd @ inertia @ qd, np.sum(J * motor**2), rtol=1e-12)


def test_gains_by_rule_make_each_joint_swing_at_the_frequency_asked_for() -> None:
    arm = load_robot("two_link")
    kp, kd = gains.gains_from_mass(arm, frequency_hz=2.0, damping_ratio=0.5)
    # the arm stretched out has the largest inertia about its first joint: rods of 1 and 0.5 m, 1 kg each
    stretched = 1.0 / 3.0 + (1.0 + 0.25) ** 2 + 0.5**2 / 12.0
    assert_allclose(kp[0], (4.0 * np.pi) ** 2 * stretched, rtol=2e-3)  # of a search
    assert_allclose(kd, 2.0 * 0.5 * kp / (4.0 * np.pi), rtol=1e-12)


def test_motor_inertia_counts_in_the_rule() -> None:
    arm = load_robot("raven2")
    motors = gains.reflected_inertia(NOMINAL.cable.rotor_inertia, FIRMWARE.ratio[:3], FIRMWARE.coupling)
    with_motors = gains.gains_from_mass(arm, motor_inertia=motors).kp - gains.gains_from_mass(arm).kp
    assert_allclose(with_motors, (10.0 * np.pi) ** 2 * np.diag(motors), rtol=1e-12)


def test_no_pose_has_more_inertia_than_the_rule_assumes() -> None:
    arm = load_robot("raven2")
    rng = np.random.default_rng(2)
    largest = gains.gains_from_mass(arm).kp / (10.0 * np.pi) ** 2
    for q in rng.uniform(arm.lower, arm.upper, (50, 3)):
        assert (np.diag(mass_matrix(arm, q)) <= 1.02 * largest).all()


def test_no_mode_of_a_long_arm_is_too_fast_for_the_loop() -> None:
    arm = load_robot("dual_arm_19")
    kp, kd = gains.gains_from_mass(arm)
    rng = np.random.default_rng(3)
    for q in rng.uniform(arm.lower, arm.upper, (30, 19)):
        # a sampled state x' = (1 + A dt) x of positions and velocities, semi-implicit as a servo sees it
        inverse = np.linalg.inv(mass_matrix(arm, q))
        speed = np.eye(19) - 1e-3 * inverse @ np.diag(kd), -1e-3 * inverse @ np.diag(kp)
        step = np.block([[speed[0], speed[1]], [1e-3 * speed[0], np.eye(19) + 1e-3 * speed[1]]])
        assert np.abs(np.linalg.eigvals(step)).max() < 1.0


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        ("raven2_full", {}, '"roll" moves no mass'),
        *(("two_link", {"frequency_hz": wrong}, "frequency_hz") for wrong in (0.0, -1.0, np.nan, np.inf)),
    ],
)
def test_impossible_gains_are_refused(robot: str, options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        gains.gains_from_mass(load_robot(robot), **options)


def test_limits_rise_to_the_largest_torque_in_twenty_milliseconds() -> None:
    limits = gains.default_limits([7.5, 95.0, np.inf], *BOX)
    sent = [limits.apply(np.array([100.0, 1e4, 1e6]), np.array([0.7, 0.35, 0.0]), 1e-3) for _ in range(25)]
    assert_allclose(sent[18][:2], 19.0 / 20.0 * np.array([7.5, 95.0]), rtol=1e-9)
    assert_allclose(sent[-1][:2], [7.5, 95.0])
    assert sent[0][2] == 1e6  # no largest torque, no largest rate
