from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.identification.cable_loops import cable_loops
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.simulated_plant import PERIOD
from catenary.spatial import Pose
from catenary.transmission.cable_elasticity import winding_of
from oracles.random_trees import Floats
from papers.plant.circles import SPACING, drawn_by, followed, read_circles


@pytest.fixture(scope="module")
def circle(recordings: Path) -> tuple[Floats, Floats]:
    """Every 50th row of a real arm drawing circles: joints (N, 6), published tip (N, 3) [m] in frame 0."""
    path = recordings / "raven2_recorded_state" / "raven_state_circle.npz"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    with np.load(path) as archive:
        jpos, position = np.deg2rad(archive["jpos"][::50]), 1e-6 * archive["pos"][::50]
    jaws = (jpos[:, 7] - jpos[:, 6]) / 2.0
    # index 3 is unused; the recorder multiplied insertion, too, by 180 / pi, so deg2rad gives metres
    joints = np.column_stack([jpos[:, 0], jpos[:, 1], jpos[:, 2], jpos[:, 4], jpos[:, 5], jaws])
    return joints, position


def test_tip_is_where_the_real_arm_reported_it(circle: tuple[Floats, Floats]) -> None:
    joints, position = circle
    model = load_robot("raven2_full")
    _, in_base = forward_kinematics(model, joints)
    frame_0 = model.frames["frame0"].pose
    assert len(joints) > 400
    # recorded: the tip truncated to 1 um, insertion with six digits (steps of 1.7 um)
    assert_allclose((in_base - frame_0.position) @ frame_0.rotation, position, atol=3e-6)


def test_recorded_configurations_are_recovered_from_their_poses(circle: tuple[Floats, Floats]) -> None:
    joints, _ = circle
    model = load_robot("raven2_full")
    for q in joints:
        pose = forward_kinematics(model, q)
        assert_allclose(inverse_kinematics(model, Pose(*pose), q), q, atol=1e-9)


def test_following_errors_are_those_that_were_measured_on_another_clock(recordings: Path) -> None:
    path = recordings / "raven2_recorded_state" / "raven_state_circle.npz"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    found = followed(load_cable_arm().firmware, read_circles(path))
    assert_allclose(found.error[:3], [0.185, 0.304, 0.358], rtol=0.08)  # deg, deg, mm; rows come in bursts
    assert_allclose(found.likeness, [0.57, -0.28, 0.94, 0.12, 0.52, -0.01], atol=0.06)


@pytest.mark.slow
def test_the_simulated_robot_draws_the_circles_with_the_friction_of_the_real_one(recordings: Path) -> None:
    path = recordings / "raven2_recorded_state" / "raven_state_circle.npz"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    circles = read_circles(path)
    real, simulated = followed(load_cable_arm().firmware, circles), drawn_by(load_cable_arm(), circles)
    assert (np.abs(simulated.friction / real.friction - 1.0) < [0.05, 0.05, 0.08]).all(), simulated.friction
    assert_allclose(simulated.error, real.error, rtol=0.15)


def test_friction_of_circles_without_an_encoder_is_that_which_was_found_by_hand(recordings: Path) -> None:
    path = recordings / "raven2_recorded_state" / "raven_state_circle.npz"
    if not path.is_file():
        pytest.skip(f"no recording {path}")
    circles, firmware = read_circles(path)[:], load_cable_arm().firmware
    time, q, asked = (each[:: round(SPACING / PERIOD)] for each in circles)
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    lag, speed = ([*winding_of(firmware.coupling, each.T[:3])] for each in (asked - q, np.gradient(q, SPACING, axis=0)))
    ratio, gearbox = firmware.ratio[:3], firmware.gearbox[:3]
    tau = (firmware.kp[:3] * np.transpose(lag) - firmware.kd[:3] * np.transpose(speed)) * ratio**2 / gearbox
    log = MotionLog(
        "circles", names, units, asked[:, :3], np.ones(len(q), bool), time=time, tau=tau, q_reported=q[:, :3]
    )
    for found, least, most, missed in zip(
        cable_loops(log)[0], (0.86, 1.29, 15.8), (0.92, 1.35, 18.5), (0.00323, 0.00531, 0.000358), strict=True
    ):
        assert found.friction.low <= most
        assert found.friction.high >= least
        assert found.following == pytest.approx(missed, rel=0.08)
        assert "pose and speed" in found.untold[0]  # circles are one motion of all joints
