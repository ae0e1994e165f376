import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, joint_numbers
from catenary.simulation.joint_impulses import finish_step
from catenary.simulation.joint_step import new_motion

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
        joints = joint_numbers(MODEL, JointHardware(friction=self.friction), *PLACES)
        motion = new_motion(3, 3)
        motion.factor[0], parts = factor, motion.parts
        parts.start[:] = MIDDLE + WIDTH * rng.choice([-1.0, 1.0, 0.3, 0.9999], 3)
        parts.start_rate[:] = rng.normal(size=3) * rng.choice([0.0, 1.0], 3)
        parts.rate[:] = parts.start_rate + 0.02 * rng.normal(size=3)
        parts.position[:] = parts.start + 0.5 * STEP * (parts.start_rate + parts.rate)
        self.free_rate = parts.rate.copy()
        assert finish_step(joints, motion, STEP)
        self.q, self.qd = parts.start, parts.start_rate
        self.impulse = self.mass @ (self.qd - self.free_rate)

    @property
    def free(self) -> np.ndarray:
        """Joints that no stop touched."""
        return (self.q > MODEL.lower) & (self.q < MODEL.upper)


seeds = st.integers(0, 10_000)


@given(seeds, st.sampled_from([0.0, 1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_no_joint_passes_its_limit(seed, friction):
    step = Finished(seed, friction)
    assert ((step.q >= MODEL.lower) & (step.q <= MODEL.upper)).all()


@given(seeds, st.sampled_from([0.0, 1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_friction_and_stops_take_energy_and_never_give_any(seed, friction):
    step = Finished(seed, friction)
    was, now = step.free_rate @ step.mass @ step.free_rate, step.qd @ step.mass @ step.qd
    assert now <= was * (1.0 + 1e-9) + 1e-12


@given(seeds, st.sampled_from([1.0, 30.0]))
@settings(deadline=None, max_examples=100)
def test_friction_stays_within_coulombs_torque_and_opposes_what_slides(seed, friction):
    step = Finished(seed, friction)
    most = step.friction * STEP
    free, sliding = step.free, np.abs(step.qd) > 1e-9
    # impulses are found to 1e-13 of velocity
    assert (np.abs(step.impulse[free]) <= most[free] + 1e-10).all()
    slides = free & sliding
    assert_allclose(step.impulse[slides], -np.sign(step.qd[slides]) * most[slides], atol=1e-10)


@given(seeds)
@settings(deadline=None, max_examples=100)
def test_stops_only_push_inwards(seed):
    step = Finished(seed, 0.0)
    at_lower, at_upper = step.q <= MODEL.lower, step.q >= MODEL.upper
    assert (step.impulse[at_lower] >= -1e-10).all()
    assert (step.impulse[at_upper] <= 1e-10).all()
    assert_allclose(step.impulse[~at_lower & ~at_upper], 0.0, atol=1e-10)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_step_that_is_not_finite_is_not_taken(bad):
    motion = new_motion(3, 3)
    motion.parts.start[:], motion.parts.position[:] = MIDDLE, MIDDLE
    motion.parts.rate[1] = bad
    assert not finish_step(joint_numbers(MODEL, JointHardware(), *PLACES), motion, STEP)
    assert_allclose(motion.parts.start, MIDDLE)
