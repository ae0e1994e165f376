import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, drive_parameters, finish_step, new_motion

MODEL = load_robot("raven2")  # three joints with limits
PLACES = np.arange(3), np.arange(3)
STEP = 1e-3
MIDDLE = 0.5 * (MODEL.lower + MODEL.upper)
WIDTH = 0.5 * (MODEL.upper - MODEL.lower)


class Finished:
    """A step from a random place at random speed, near or at a stop now and then, before and after its impulses."""

    def __init__(self, seed: int, friction: float) -> None:
        rng = np.random.default_rng(seed)
        factor = np.tril(rng.normal(size=(3, 3)))
        self.mass = factor @ factor.T + 0.05 * np.eye(3)
        factor = np.linalg.cholesky(self.mass)
        self.friction = friction * rng.uniform(0.0, 1.0, 3)
        joints = drive_parameters(MODEL, JointHardware(friction=self.friction), *PLACES)
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
    assert ((step.q >= MODEL.lower) & (step.q <= MODEL.upper)).all()
    was, now = step.free_rate @ step.mass @ step.free_rate, step.qd @ step.mass @ step.qd
    assert now <= was * (1.0 + 1e-9) + 1e-12


@given(seeds, st.sampled_from([0.0, 1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_friction_stays_within_coulombs_torque_and_stops_only_push_inwards(seed, friction):
    step = Finished(seed, friction)
    most = step.friction * STEP
    free = (step.q > MODEL.lower) & (step.q < MODEL.upper)  # joints that no stop touched
    # impulses are found to 1e-13 of velocity
    assert (np.abs(step.impulse[free]) <= most[free] + 1e-10).all()
    slides = free & (np.abs(step.qd) > 1e-9)
    assert_allclose(step.impulse[slides], -np.sign(step.qd[slides]) * most[slides], atol=1e-10)
    assert (step.impulse[step.q <= MODEL.lower] >= -most[step.q <= MODEL.lower] - 1e-10).all()
    assert (step.impulse[step.q >= MODEL.upper] <= most[step.q >= MODEL.upper] + 1e-10).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_step_that_is_not_finite_is_not_taken(bad):
    motion = new_motion(3, 3)
    motion.start[:], motion.position[:] = MIDDLE, MIDDLE
    motion.rate[1] = bad
    assert not finish_step(drive_parameters(MODEL, JointHardware(), *PLACES), motion, STEP)
    assert_allclose(motion.start, MIDDLE)
