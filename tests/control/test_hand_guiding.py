"""Hand guiding with loads that nobody told, and loops that a collision ends."""

import numpy as np
import pytest

from catenary.control.collision_guard import CollisionGuard
from catenary.control.gains import gains_from_mass
from catenary.control.hand_guiding import HandGuiding
from catenary.control.loop import run_loop
from catenary.control.pd import GravityPD
from catenary.dynamics.external_torque import MomentumObserver
from catenary.dynamics.inverse_dynamics import forward_dynamics
from catenary.dynamics.kinematics import forward_kinematics, jacobian
from catenary.errors import InputError, LimitError
from catenary.gravity.payload import Payload
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Reference, Rest

ARM = load_robot("panda")
POSE = np.array([0.0, 0.3, 0.0, -1.6, 0.0, 1.9, 0.0])
GAINS = gains_from_mass(ARM, frequency_hz=8.0, damping_ratio=1.0)
DEVIATION = np.array([0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])  # [Nm]
NOWHERE = Reference(*np.full((3, 7), np.nan))


def guiding(**options):
    return HandGuiding(ARM, *GAINS, deviation=DEVIATION, max_payload=3.5, **options)


@pytest.mark.parametrize("seed", [1, 3, 5, 7])
def test_a_load_that_nobody_told_is_weighed_within_a_second_and_does_not_fall(seed):
    rng = np.random.default_rng(seed)
    q, load = POSE + rng.uniform(-0.3, 0.3, 7), Payload(rng.uniform(0.0, 3.0), position=rng.uniform(-0.08, 0.08, 3))
    plant, hold, seen = MujocoPlant(ARM, start=q, payload=load), guiding(), []
    plant.home()
    run_loop(plant, hold, Rest(q, 3.0), observers=[lambda tick: seen.append((tick.time, hold.mass, tick.state.q))])
    told = next(mass for time, mass, _ in seen if time >= 1.0)
    assert told == pytest.approx(load.mass, abs=0.15)
    assert hold.state == "guided"
    assert hold.mass == pytest.approx(load.mass, abs=hold.mass_half_width)
    height = [forward_kinematics(ARM, row).position[2] for _, _, row in seen[:: len(seen) - 1]]
    assert height[0] - height[1] < 0.02  # [m]


@pytest.mark.parametrize("mass", [3.7, 6.0])
def test_a_load_above_the_bound_is_refused_and_held(mass):
    plant, hold = MujocoPlant(ARM, start=POSE, payload=Payload(mass)), guiding()
    plant.home()
    run_loop(plant, hold, Rest(POSE, 4.0))
    assert hold.state == "refused"
    assert hold.mass - hold.mass_half_width > 3.5 or mass < 3.8
    assert np.abs(plant.measured_js().q - POSE).max() < 0.02


class Hand:
    """An arm whose load changes and that a hand pushes, by forward dynamics and a little viscous friction."""

    def __init__(self, hold, mass=0.0):
        self.hold, self.t, self.q, self.qd, self.tau = hold, 0.0, POSE.copy(), np.zeros(7), np.zeros(7)
        self.carry(mass)

    def carry(self, mass):
        self.arm = Payload(mass, position=(0.0, 0.0, 0.05)).on(ARM) if mass else ARM

    def run(self, seconds, push=(0.0, 0.0, 0.0), dt=0.001):
        """Return the states of guiding that were passed."""
        passed = []
        for _ in range(round(seconds / dt)):
            state = JointState(self.t, self.q.copy(), self.qd.copy(), self.tau, np.zeros(0), LEVEL, 0.0)
            self.tau = self.hold.torque(state, NOWHERE)
            outside = jacobian(ARM, self.q)[:3].T @ np.array(push) - 0.3 * self.qd
            self.qd = self.qd + dt * forward_dynamics(self.arm, self.q, self.qd, self.tau + outside, LEVEL)
            self.q, self.t = self.q + dt * self.qd, self.t + dt
            passed += [self.hold.state] if passed[-1:] != [self.hold.state] else []
        return passed


def test_a_hand_moves_the_arm_and_a_load_that_it_takes_up_is_carried():
    hand = Hand(guiding(), 0.5)
    assert hand.run(2.0) == ["weighing", "guided"]
    assert hand.run(0.5, push=(8.0, 6.0, 0.0)) == ["guided"]
    moved = np.abs(hand.q - POSE).max()
    assert moved > 0.05
    hand.run(1.0)
    before = forward_kinematics(ARM, hand.q).position[2]
    hand.carry(2.5)
    assert hand.run(1.0) == ["guided", "weighing"]
    assert hand.hold.mass == pytest.approx(2.5, abs=0.15)
    assert hand.run(3.0) == ["weighing", "guided"]
    assert hand.hold.mass == pytest.approx(2.5, abs=0.1)
    assert before - forward_kinematics(ARM, hand.q).position[2] < 0.1  # [m] that it sank by
    hand.carry(0.0)
    assert hand.run(4.0) == ["guided", "weighing", "guided"]
    assert hand.hold.mass == pytest.approx(0.0, abs=0.1)


def test_a_push_beyond_a_hands_makes_it_hold():
    hand = Hand(guiding(max_push=20.0))
    hand.run(1.5)
    assert hand.run(0.3, push=(0.0, 40.0, 0.0))[:2] == ["guided", "weighing"]
    assert np.abs(hand.qd).max() < 0.8


def test_reset_weighs_anew_and_impossible_options_are_refused():
    hand = Hand(guiding(), 1.0)
    hand.run(1.5)
    hand.hold.reset()
    assert (hand.hold.state, hand.hold.mass) == ("weighing", 0.0)
    for wrong in ({"max_push": 0.0}, {"damping": -1.0}, {"frame": "nowhere"}):
        with pytest.raises(InputError):
            guiding(**wrong)


@pytest.mark.parametrize("force", [0.0, 15.0])
def test_a_collision_of_15_newtons_ends_a_loop_within_50_ms(force):
    plant, begin = MujocoPlant(ARM, start=POSE), 0.5
    plant.home()
    guard = CollisionGuard(MomentumObserver(ARM, deviation=DEVIATION))
    controller = GravityPD(ARM, *GAINS)

    class Pushed:
        """The controller's torques, with a push by whoever is in the way, that the robot does not report."""

        def torque(self, state, reference):
            push = force * (state.time >= begin) * np.array([0.6, 0.0, -0.8])
            return controller.torque(state, reference) + jacobian(ARM, state.q)[:3].T @ push

    def look(tick):
        push = force * (tick.state.time >= begin + 0.001) * np.array([0.6, 0.0, -0.8])
        reported = tick.state.tau - jacobian(ARM, tick.state.q)[:3].T @ push
        guard(tick._replace(state=tick.state._replace(tau=reported)))

    if force == 0.0:
        run_loop(plant, Pushed(), Rest(POSE, 1.0), observers=[look])
        return
    with pytest.raises(
        LimitError, match=r"collision at 0\.5\d+ s, by q\d.*: q\d is asked for .* Nm from outside"
    ) as told:
        run_loop(plant, Pushed(), Rest(POSE, 1.0), observers=[look])
    assert float(str(told.value).split()[2]) < begin + 0.05
    assert plant.operating_state().state == "PAUSED"


def test_a_guard_without_a_deviation_is_refused():
    with pytest.raises(InputError, match="expected an observer with a deviation"):
        CollisionGuard(MomentumObserver(ARM))
