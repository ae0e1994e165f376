import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.control.carrying import Carrying
from catenary.control.gravity_pd import GravityPD
from catenary.control.loop import run_loop
from catenary.control.pd import JointPD
from catenary.errors import InputError
from catenary.gravity.payload import CarriedLoad, Payload
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference
from oracles.hanging_plant import HangingPlant, Poses

ARM = load_robot("raven2")
RNG = np.random.default_rng(0)
KP, KD = RNG.uniform(50.0, 90.0, ARM.n), RNG.uniform(1.0, 9.0, ARM.n)
PLACE = (0.02, -0.05, 0.01)


def random_tick() -> tuple[JointState, Reference]:
    n = ARM.n
    q, qd, q_ref, qd_ref = RNG.normal(size=(4, n))
    gravity, rates = RNG.normal(size=3), RNG.normal(size=(2, 3))
    state = JointState(0.0, q, qd, np.zeros(n), np.zeros(0), gravity, 0.0, rates)
    return state, Reference(q_ref, qd_ref, np.zeros(n))


def test_the_torque_is_that_of_a_robot_that_is_so_much_heavier() -> None:
    load = CarriedLoad(ARM)
    carries = Carrying(GravityPD(ARM, KP, KD), load)
    load.attach(1.3, "wrist", PLACE)
    heavier = GravityPD(Payload(1.3, "wrist", PLACE).on(ARM), KP, KD)
    for _ in range(10):
        state, reference = random_tick()
        assert_allclose(carries.torque(state, reference), heavier.torque(state, reference), atol=1e-9)


def test_without_a_load_the_torques_are_the_controllers_to_the_bit() -> None:
    load = CarriedLoad(ARM)
    inner = GravityPD(ARM, KP, KD)
    carries = Carrying(inner, load)
    state, reference = random_tick()
    state.q[0] = -0.0
    plain = inner.torque(state, reference).copy()
    assert_array_equal(carries.torque(state, reference), plain)
    load.attach(2.0, "wrist")
    assert np.abs(carries.torque(state, reference) - plain).max() > 0.1
    load.attach(0.0, "wrist")
    assert carries.torque(state, reference).tobytes() == plain.tobytes()
    load.attach(2.0, "wrist")
    load.detach()
    assert carries.torque(state, reference).tobytes() == plain.tobytes()


def test_a_load_that_is_announced_in_a_running_loop_makes_the_arm_sag_no_more() -> None:
    model, pose = load_robot("planar_3r"), np.array([0.3, -0.5, 0.7])
    loaded = Payload(0.8).on(model)
    upright = np.array([0.0, 0.0, -9.81])
    sag = {}
    for announced in (False, True):
        load = CarriedLoad(model)
        plant = HangingPlant(model, pose, upright, loaded=loaded, pick_up=0.5)
        controller = Carrying(GravityPD(model, np.full(3, 100.0), np.full(3, 20.0)), load)

        def announce(tick, load=load, announced=announced) -> None:
            if announced and tick.number == 499:  # its torque acts from the next tick on
                load.attach(0.8)

        run_loop(plant, controller, Poses(pose[None], 2.0), observers=[announce])
        sag[announced] = np.abs(plant.q - pose).max()
    assert sag[False] > 0.01
    assert sag[True] < 1e-6


def test_a_load_of_another_robot_is_refused() -> None:
    carries = Carrying(JointPD(KP, KD), CarriedLoad(load_robot("panda")))
    with pytest.raises(InputError, match="is for 7 joints, the robot has 3"):
        carries.torque(*random_tick())
