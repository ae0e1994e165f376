import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import MotionLog
from catenary.recording.raven_transmission import COUNTS_PER_RADIAN
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.workflows.robot.motion import move_to
from papers.beyond.registration import (
    AXES,
    ELBOW_FIRST,
    HOME_POSE,
    OFFSETS,
    carried_back,
    home_watched,
    registration,
    shift_of,
)
from papers.calibration.recordings import homed

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
    return homed(None)


@pytest.mark.slow
def test_joint_2_is_registered_off_its_stop_where_it_met_it_before_joint_1(plant: CablePlant) -> None:
    shifts = []
    for pose in (HOME_POSE, HOME_POSE, ELBOW_FIRST):
        move_to(plant, pose, joints=AXES)
        seek = home_watched(plant)
        shifts.append(registration(plant)[1])
    error = plant.firmware.coupling[0] - plant.cable.coupling[0]
    assert abs(shifts[1] - shifts[0]) < np.deg2rad(0.02)  # cables set by as much between homings
    assert seek.shoulder_after_elbow > np.deg2rad(30.0)  # of 60 deg at 10 deg/s, elbow 2.75 s on its way
    moved = shifts[2] - shifts[1]
    # what the cable's wind-up at the stop does not take of the coupling's error
    assert 0.0 < seek.elbow_left < moved < 1.05 * error * seek.shoulder_after_elbow
    assert_allclose(seek.q[-1], seek.registered, atol=np.deg2rad(0.5))
