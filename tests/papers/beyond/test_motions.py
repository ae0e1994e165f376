"""Motions, bases and homings of experiments that no paper has."""

from math import gcd

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, MotionLog, Reference, gravity_torque, load_robot, potential_energy, random_sinusoids
from catenary.calibration.fit_options import FitOptions
from catenary.plant import AT_REST
from catenary.raven2.transmission import COUNTS_PER_RADIAN
from catenary.simulation.cable_parameters import RAVEN2_STIFF, load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.trajectories.sinusoids import FASTEST_SPEEDS, SLOWEST_SPEEDS
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER
from catenary.workflows.gravity_trials import rigid_arm
from papers.beyond.calibration_and_gravity import CalibratedGravity
from papers.beyond.paths import crossings, designed
from papers.beyond.registration import OFFSETS, carried_back, shift_of
from papers.beyond.tilted_calibration import AXES, BASES, DIFFERENCE, GRAVITY, with_gravity
from papers.calibration.figure_3 import reversals
from papers.calibration.recordings import fitted, homed

SECONDS = 204.0


WIDTH = CALIBRATION_UPPER - CALIBRATION_LOWER


def sampled(path) -> np.ndarray:
    return path.sample(np.arange(0.0, path.duration, 0.05))[0]


def test_a_designed_motion_crosses_the_range_as_often_as_told_and_as_random_motion_does() -> None:
    q = sampled(designed(SECONDS))
    counts = crossings(SECONDS, WIDTH, (SLOWEST_SPEEDS + FASTEST_SPEEDS) / 2.0)
    assert [reversals(column) + 1 for column in q.T] == counts
    assert all(gcd(a, b) == 1 for k, a in enumerate(counts) for b in counts[:k])
    drawn = sampled(random_sinusoids(np.random.default_rng(0), SECONDS))
    at_random = [reversals(column) + 1 for column in drawn.T]
    assert_allclose(counts, at_random, rtol=0.5)
    assert ((q >= CALIBRATION_LOWER) & (q <= CALIBRATION_UPPER)).all()


FIRMWARE = load_cable_arm().firmware


Q = np.random.default_rng(0).uniform(-1.0, 1.0, (7, 3))


def offsets_of(q: np.ndarray) -> np.ndarray:
    """Counts to take off so that the joints read q where the encoders count zero, by the manual's coupling."""
    c01, c02, c12 = FIRMWARE.coupling
    winding = np.stack([q[:, 0], q[:, 1] + c01 * q[:, 0], q[:, 2] + c02 * q[:, 0] + c12 * q[:, 1]], axis=-1)
    return -winding * FIRMWARE.ratio[:3] * COUNTS_PER_RADIAN


def test_offsets_shift_joints_through_the_coupling() -> None:
    assert_allclose(shift_of(FIRMWARE, offsets_of(Q)), Q, atol=1e-9)


def test_a_recording_carried_back_is_that_of_the_other_registration() -> None:
    shift, to = Q, np.array([0.1, -0.2, 0.003])
    signals = dict(zip(OFFSETS, offsets_of(shift).T, strict=True))
    reported = np.ones((7, 3)) + shift
    log = MotionLog("made up", AXES, ("rad", "rad", "m"), reported, np.ones(7, bool), signals=signals)
    assert_allclose(carried_back(log, FIRMWARE, to).q_nominal, np.ones((7, 3)) + to, atol=1e-9)


@pytest.fixture(scope="module")
def plant() -> CablePlant:
    return homed(None, arm=load_cable_arm(RAVEN2_STIFF))  # whose coupling is a third off


RNG = np.random.default_rng(0)


ARM = load_robot("raven2")


def log(rows: int = 5) -> MotionLog:
    q = RNG.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (rows, 3))
    return MotionLog(
        "made up", AXES, ("rad", "rad", "m"), q, np.ones(rows, bool),
        time=np.linspace(0.0, 1.0, rows), tau=RNG.uniform(-1.0, 1.0, (rows, 3)),
    )  # fmt: skip


@pytest.mark.parametrize("base", BASES)
def test_gravity_among_the_inputs_is_the_slope_of_potential_energy(base: str) -> None:
    recorded, start, h = log(), 3.0, 1e-6
    samples = BASES[base].sample(start + recorded.time)
    gravity = np.broadcast_to(samples.gravity, (5, 3))  # the origin is on the axis of rocking: no acceleration
    found = with_gravity(recorded, BASES[base], start)
    for j, name in enumerate(GRAVITY):
        step = h * np.eye(3)[j]
        slope = [
            (potential_energy(ARM, q + step, g) - potential_energy(ARM, q - step, g)) / (2.0 * h)
            for q, g in zip(recorded.q_nominal, gravity, strict=True)
        ]
        assert_allclose(found.signals[name], slope, atol=1e-6)  # central difference
        assert_allclose(found.signals[name] + found.signals[DIFFERENCE[j]], recorded.tau[:, j], atol=1e-12)


def test_gravity_is_computed_at_the_calibrated_joints() -> None:
    pytest.importorskip("mujoco")
    rng, shift = np.random.default_rng(0), np.array([0.1, -0.2, 0.01])
    q = rng.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (30, 3))
    tau = rng.uniform(-1.0, 1.0, (30, 3))
    log = MotionLog("off by a shift", AXES, ("rad", "rad", "m"), q, np.ones(30, bool), q + shift, tau=tau)
    arm = rigid_arm(load_robot("raven2"))
    controller = CalibratedGravity(arm, fitted([log], FitOptions("linear")), gains=True)
    gravity, at = np.array([1.0, -2.0, -9.0]), q.mean(axis=0)
    state = JointState(0.0, at, np.zeros(3), np.zeros(3), np.zeros(0), gravity, 0.0, AT_REST)
    error = np.array([0.01, 0.02, 0.001])
    found = controller.torque(state, Reference(at + error, np.zeros(3), np.zeros(3)))
    expected = gravity_torque(arm.model, at + shift, gravity)
    assert_allclose(controller.feedforward, expected, atol=1e-9)
    assert_allclose(found - expected, arm.gains.kp * error, atol=1e-9)  # PD stays on reported joints
