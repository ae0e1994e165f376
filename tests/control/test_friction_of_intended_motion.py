"""Coulomb friction helped over on a simulated arm: follows closer, and nothing moves by itself."""

import numpy as np
import pytest

from catenary.control.loop import run_loop
from catenary.control.pd import GravityHold, GravityPD
from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.trajectories.reference import Reference

ARM, FRICTION, START = load_robot("two_link"), 0.8, np.array([0.4, 0.6])
GAINS = np.array([60.0, 30.0]), np.array([6.0, 2.0])


class Waves:
    """There and back by 0.3 rad in eight seconds, slowly beside the arm's inertia, then rest."""

    duration = 9.0

    def __init__(self, moves: float = 8.0) -> None:
        self.moves = moves

    def __call__(self, time: float) -> Reference:
        w, t = np.pi / 4.0, min(time, self.moves)
        moving = float(time < self.moves)
        angle = np.array([w * t, w * t])
        q, qd = START + 0.15 * (1.0 - np.cos(angle)), 0.15 * w * np.sin(angle) * moving
        return Reference(q, qd, 0.15 * w**2 * np.cos(angle) * moving)


def followed(controller, moves=8.0):
    plant = MujocoPlant(ARM, start=START, hardware=JointHardware(friction=FRICTION, armature=0.01))
    plant.home()
    seen = []

    class Watch:
        def __call__(self, tick) -> None:
            seen.append(plant.measured_js().q.copy())

    run_loop(plant, controller, Waves(moves), observers=(Watch(),), max_speed=np.inf)
    wanted = np.array([Waves(moves)(k * 1e-3).q for k in range(len(seen))])
    return np.array(seen), wanted


class MeasuredDirection(GravityPD):
    """What is told of friction compensation that hunts: the sign of what moves, or would move."""

    def torque(self, state, reference):
        return super().torque(state, reference) + 1.5 * FRICTION * np.sign(reference.q - state.q)


def test_intended_direction_follows_closer_and_rests_where_the_errors_sign_hunts():
    plain, helped = GravityPD(ARM, *GAINS), GravityPD(ARM, *GAINS, friction=FRICTION)
    errors, rests = {}, {}
    for name, controller in (("plain", plain), ("helped", helped), ("hunts", MeasuredDirection(ARM, *GAINS))):
        q, wanted = followed(controller)
        errors[name] = np.sqrt(np.mean((q - wanted)[200:8000] ** 2))
        rests[name] = np.ptp(q[-800:], axis=0).max()
    assert errors["helped"] < 0.4 * errors["plain"]
    assert rests["helped"] == pytest.approx(0.0, abs=1e-6)
    assert rests["hunts"] > 1e-5


@pytest.mark.parametrize("share", [1.0, 2.0])
def test_more_than_the_friction_sets_nothing_going_while_the_reference_rests(share):
    q, _ = followed(GravityPD(ARM, *GAINS, friction=share * FRICTION))
    assert np.ptp(q[-300:], axis=0).max() < 1e-6


def test_an_arm_led_by_hand_is_lighter_and_comes_to_rest_by_itself():
    """Pushed off at 1 rad/s, it goes farther with most of its friction carried, and stops."""
    ways = []
    for share in (0.0, 0.8):
        plant = MujocoPlant(ARM, start=START, hardware=JointHardware(friction=FRICTION, armature=0.01))
        plant.home()
        plant.state_command("enable")
        hold, still = GravityHold(ARM, friction=share * FRICTION), Waves(0.0)(0.0)
        for k in range(3000):
            push = np.array([3.0, 1.5]) if k < 100 else 0.0
            plant.servo_jf(hold.torque(plant.measured_js(), still) + push)
            plant.wait()
        state = plant.measured_js()
        assert np.abs(state.qd).max() < 1e-9
        ways.append(np.abs(state.q - START).max())
    assert ways[1] > 2.0 * ways[0] > 0.0
