import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, drive_parameters, finish_step, new_motion
from catenary.simulation.mujoco_plant import MujocoPlant

MODEL = load_robot("planar_3r")
PLACES = np.array([6, 7, 8]), np.array([7, 8, 9])


def test_drives_act_on_the_rotors_of_elastic_joints():
    hardware = JointHardware(friction=[1, 2, 3], armature=0.5, stiffness=[np.inf, 10, np.inf])
    numbers = drive_parameters(MODEL, hardware, *PLACES)
    assert numbers.drive.tolist() == [0, 3, 2]
    assert numbers.friction.tolist() == [1, 0, 3, 2]
    assert numbers.inertia.tolist() == [0.5, 0, 0.5, 0.5]


@pytest.mark.parametrize(
    ("hardware", "complaint"),
    [
        (JointHardware(friction=-1.0), "friction"),
        (JointHardware(friction=[1.0]), "friction"),
        (JointHardware(damping=np.nan), "damping"),
        (JointHardware(armature="heavy"), "armature"),
        (JointHardware(spring_damping=np.inf), "spring_damping"),
        (JointHardware(stiffness=100.0), 'link1": stiffness 100 and armature 0.*above zero'),
        (JointHardware(stiffness=0.0, armature=1.0), "above zero"),
        (JointHardware(stiffness=np.nan), "stiffness"),
    ],
)
def test_numbers_that_no_joint_has_are_refused(hardware, complaint):
    with pytest.raises(InputError, match=complaint):
        drive_parameters(MODEL, hardware, *PLACES)


@pytest.mark.parametrize(
    "hardware",
    [
        JointHardware(damping=1e5),
        JointHardware(stiffness=1e7, armature=0.1),
        JointHardware(stiffness=1e3, armature=0.1, spring_damping=1e4),
    ],
)
def test_springs_and_dampers_too_stiff_for_the_step_are_refused(hardware):
    with pytest.raises(InputError, match="as many substeps"):
        MujocoPlant(load_robot("two_link"), hardware=hardware)


def test_as_many_substeps_as_the_complaint_says_are_enough():
    model, stiff = load_robot("two_link"), JointHardware(stiffness=1e6, armature=0.1)
    with pytest.raises(InputError) as complaint:
        MujocoPlant(model, hardware=stiff)
    times = int(str(complaint.value).split("at least ")[1].split()[0])
    q = np.array([0.5, 0.3])
    plant = MujocoPlant(model, start=q, hardware=stiff, substeps=times)
    plant.home()
    for _ in range(500):
        plant.servo_jf(gravity_torque(model, q, [0.0, 0.0, -9.81]))
        plant.wait()
    # springs wind up by tau / K, and what swings stays that small
    assert_allclose(plant.telemetry()["q_true"], q, atol=1e-4)


def test_joints_that_move_no_mass_are_refused_by_name_until_they_have_a_rotor():
    with pytest.raises(InputError, match="roll, wrist, tool"):
        MujocoPlant(load_robot("raven2_full"))
    MujocoPlant(load_robot("raven2_full"), hardware=JointHardware(armature=1e-4))


RAVEN = load_robot("raven2")  # three joints with limits
WHERE = np.arange(3), np.arange(3)
STEP = 1e-3
MIDDLE = 0.5 * (RAVEN.lower + RAVEN.upper)
WIDTH = 0.5 * (RAVEN.upper - RAVEN.lower)


class Finished:
    """A step from a random place at random speed, near or at a stop now and then, before and after its impulses."""

    def __init__(self, seed: int, friction: float) -> None:
        rng = np.random.default_rng(seed)
        factor = np.tril(rng.normal(size=(3, 3)))
        self.mass = factor @ factor.T + 0.05 * np.eye(3)
        factor = np.linalg.cholesky(self.mass)
        self.friction = friction * rng.uniform(0.0, 1.0, 3)
        joints = drive_parameters(RAVEN, JointHardware(friction=self.friction), *WHERE)
        parts = motion = new_motion(3, 3)
        motion.factor[0] = factor
        parts.start[:] = MIDDLE + WIDTH * rng.choice([-1.0, 1.0, 0.3, 0.9999], 3)
        parts.start_rate[:] = rng.normal(size=3) * rng.choice([0.0, 1.0], 3)
        parts.rate[:] = parts.start_rate + 0.02 * rng.normal(size=3)
        parts.position[:] = parts.start + 0.5 * STEP * (parts.start_rate + parts.rate)
        self.free_rate = parts.rate.copy()
        assert finish_step(joints, motion, STEP)
        self.q, self.qd = parts.start, parts.start_rate
        self.impulse = self.mass @ (self.qd - self.free_rate)


seeds = st.integers(0, 10_000)


@given(seeds, st.sampled_from([0.0, 1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_no_joint_passes_its_limit_and_no_energy_is_given(seed, friction):
    step = Finished(seed, friction)
    assert ((step.q >= RAVEN.lower) & (step.q <= RAVEN.upper)).all()
    was, now = step.free_rate @ step.mass @ step.free_rate, step.qd @ step.mass @ step.qd
    assert now <= was * (1.0 + 1e-9) + 1e-12


@given(seeds, st.sampled_from([0.0, 1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_friction_stays_within_coulombs_torque_and_stops_only_push_inwards(seed, friction):
    step = Finished(seed, friction)
    most = step.friction * STEP
    free = (step.q > RAVEN.lower) & (step.q < RAVEN.upper)  # joints that no stop touched
    # impulses are found to 1e-13 of velocity
    assert (np.abs(step.impulse[free]) <= most[free] + 1e-10).all()
    slides = free & (np.abs(step.qd) > 1e-9)
    assert_allclose(step.impulse[slides], -np.sign(step.qd[slides]) * most[slides], atol=1e-10)
    assert (step.impulse[step.q <= RAVEN.lower] >= -most[step.q <= RAVEN.lower] - 1e-10).all()
    assert (step.impulse[step.q >= RAVEN.upper] <= most[step.q >= RAVEN.upper] + 1e-10).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_step_that_is_not_finite_is_not_taken(bad):
    motion = new_motion(3, 3)
    motion.start[:], motion.position[:] = MIDDLE, MIDDLE
    motion.rate[1] = bad
    assert not finish_step(drive_parameters(RAVEN, JointHardware(), *WHERE), motion, STEP)
    assert_allclose(motion.start, MIDDLE)
