import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointPD, load_robot, mass_matrix, run_loop
from catenary.control.loop import Tick
from catenary.simulation.base_motion import RockingBase
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity_trials import RAVEN_START, rigid_arm
from papers.gravity import coupling
from papers.gravity.raven_base import Z0

NOTHING = coupling.Sensing(coupling.blind, coupling.blind)


@pytest.mark.slow
def test_response_of_joints_to_a_rocking_base_is_that_of_the_simulated_bodies() -> None:
    hz, amplitude = 2.0, 0.005
    model, rotors = load_robot("raven2"), np.array([0.5, 0.3, 5.0])
    linear = coupling.raven_on("turn")
    linear = linear._replace(mass=mass_matrix(model, np.array([RAVEN_START]))[0] + np.diag(rotors))
    base = RockingBase(np.deg2rad(coupling.BASE_DEG), amplitude, hz, tuple(Z0.tolist()))
    arm = rigid_arm(model, base=base, start=RAVEN_START, motor_inertia=rotors)
    ticks: list[tuple[float, float]] = []

    def observe(tick: Tick) -> None:
        ticks.append((tick.state.time, tick.state.q[0]))

    run_loop(arm.plant, JointPD(linear.kp, linear.kd), Rest(RAVEN_START, 1.5), observers=[observe])
    time, q = np.array(ticks)[-1000:].T  # two periods, after the gains' transient
    angle = 2 * np.pi * hz * time
    wave = np.stack([np.sin(angle), np.cos(angle), np.ones(len(time))], axis=1)
    fit = np.linalg.lstsq(wave, q, rcond=None)[0]
    expected = abs(coupling.joint_response(linear, hz, NOTHING)[0, 0])
    # gravity's own stiffness, a hundredth of kp, and the loop's delay are not in the linear arm
    assert np.hypot(fit[0], fit[1]) / amplitude == pytest.approx(expected, rel=0.05)


def grows(arm: coupling.Linear, base_hz: float, size: float, zeta: float, delay: float) -> bool:
    """One joint on a base with a delayed accelerometer, integrated in time: does a small push swing up?"""
    dt, seconds = 2e-4, 8.0
    (m, kp, kd, h), w = (v.item() for v in (arm.mass, arm.kp, arm.kd, arm.h)), 2 * np.pi * base_hz
    lag = round(delay / dt)
    past = [0.0] * (lag + 1)
    x, v, q, p = 0.0, 1.0, 0.0, 0.0
    largest = [0.0, 0.0]
    inverse = np.linalg.inv([[size, h], [h, m]])
    steps = round(seconds / dt)
    for k in range(steps):
        tau = -kp * q - kd * p + h * past[k % (lag + 1)]
        force = -size * (2 * zeta * w * v + w * w * x)
        a, b = inverse[0, 0] * force + inverse[0, 1] * tau, inverse[1, 0] * force + inverse[1, 1] * tau
        past[k % (lag + 1)] = a
        v, p = v + dt * a, p + dt * b
        x, q = x + dt * v, q + dt * p
        half = 0 if k < steps // 2 else 1
        largest[half] = max(largest[half], abs(x))
    return largest[1] > largest[0]


ONE = coupling.Linear(np.array([[1.0]]), np.array([400.0]), np.array([20.0]), np.array([1.0]), np.zeros(1))


@pytest.mark.parametrize("base_hz", [3.0, 6.0, 10.0])
@pytest.mark.parametrize("size", [3.0, 12.0])
def test_count_of_unstable_roots_foretells_whether_a_base_swings_up(base_hz: float, size: float) -> None:
    delay = 0.02
    sensing = coupling.Sensing(lambda hz: np.exp(-2j * np.pi * hz * delay), coupling.blind)
    unstable = coupling.unstable_roots(ONE, sensing, base_hz, size, 0.005, most_hz=300.0)
    assert unstable in (0, 2)
    assert (unstable > 0) == grows(ONE, base_hz, size, 0.005, delay)


def test_largest_unstable_base_swings_up_and_a_larger_one_does_not() -> None:
    delay = 0.02
    sensing = coupling.Sensing(lambda hz: np.exp(-2j * np.pi * hz * delay), coupling.blind)
    largest = coupling.largest_unstable_base(ONE, sensing, 6.0, 0.005, most_hz=300.0)
    assert grows(ONE, 6.0, 0.9 * largest, 0.005, delay)  # sizes tried are 5 % apart
    assert not grows(ONE, 6.0, 1.1 * largest, 0.005, delay)


def test_no_base_is_lighter_than_the_arm() -> None:
    assert_allclose(coupling.raven_on("x").own, 0.494 + 0.750 + 0.231)  # the makers' masses
    blind_arm = coupling.raven_on("x")  # its reaction alone: physics, which never swings up
    assert coupling.largest_unstable_base(blind_arm, NOTHING, 10.0) == 0.0
