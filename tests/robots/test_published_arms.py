"""The catalogue's industrial arms against what their makers say of them, in the makers' own terms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.spatial import STANDARD_GRAVITY
from oracles.dh_products import standard
from oracles.tree_poses import frame_pose

ARMS = ["panda", "ur5e", "ur10e", "iiwa14", "gen3"]

# Universal Robots' article on parameters for kinematics and dynamics: a and d [m] of its standard table, whose angles
# alpha are 90, 0, 0, 90, -90, 0 degrees; masses [kg], centres of mass [m] in the table's frames
UR_ALPHA = np.deg2rad([90, 0, 0, 90, -90, 0])
UR = {
    "ur5e": (
        [0, -0.425, -0.3922, 0, 0, 0],
        [0.1625, 0, 0, 0.1333, 0.0997, 0.0996],
        [3.761, 8.058, 2.846, 1.37, 1.3, 0.365],
        [
            [0, -0.02561, 0.00193],
            [0.2125, 0, 0.11336],
            [0.15, 0, 0.0265],
            [0, -0.0018, 0.01634],
            [0, 0.0018, 0.01634],
            [0, 0, -0.001159],
        ],
    ),
    "ur10e": (
        [0, -0.6127, -0.57155, 0, 0, 0],
        [0.1807, 0, 0, 0.17415, 0.11985, 0.11655],
        [7.369, 13.051, 3.989, 2.1, 1.98, 0.615],
        [[0.021, 0, 0.027], [0.38, 0, 0.158], [0.24, 0, 0.068], [0, 0.007, 0.018], [0, 0.007, 0.018], [0, 0, -0.026]],
    ),
}


def standard_poses(a, d, q):
    """Poses of the frames of a standard table in its base."""
    poses, above = [], np.eye(4)
    for k, angle in enumerate(q):
        above = above @ standard(UR_ALPHA[k], a[k], d[k], angle)
        poses.append(above)
    return poses


@pytest.mark.parametrize("name", UR)
def test_a_universal_robot_stands_where_its_makers_standard_table_puts_it(name, rng):
    model, (a, d, _, _) = load_robot(name), UR[name]
    base = frame_pose(model, "base", np.zeros(6))
    for q in rng.uniform(-np.pi, np.pi, size=(20, 6)):
        assert_allclose(frame_pose(model, "tool0", q), base @ standard_poses(a, d, q)[-1], atol=1e-12)


@pytest.mark.parametrize("name", UR)
def test_a_universal_robots_gravity_is_the_gradient_of_energy_by_its_makers_table(name, rng):
    model, (a, d, masses, coms) = load_robot(name), UR[name]
    base = frame_pose(model, "base", np.zeros(6))

    def energy(q, gravity):
        places = [(base @ pose @ [*com, 1])[:3] for pose, com in zip(standard_poses(a, d, q), coms, strict=True)]
        return -sum(m * gravity @ place for m, place in zip(masses, places, strict=True))

    step = 1e-6 * np.eye(6)
    for q in rng.uniform(-np.pi, np.pi, size=(10, 6)):
        gravity = rng.normal(size=3) * 6.0
        slope = [(energy(q + dq, gravity) - energy(q - dq, gravity)) / 2e-6 for dq in step]
        assert_allclose(gravity_torque(model, q, gravity), slope, atol=1e-6)  # central difference


@pytest.mark.parametrize(
    ("name", "base", "weight", "off"),
    [
        ("panda", 0.63, 17.8, 0.07),  # FCI data sheet: about 18 kg; identified masses need not add up
        ("ur5e", 4.0, 20.6, 0.06),  # data sheets, cable included; the base's 4 kg is an estimate
        ("ur10e", 4.0, 33.5, 0.02),
        ("iiwa14", 5.0, 29.9, 0.03),  # data sheet
        ("gen3", 1.697, 8.2, 0.01),  # user guide
    ],
)
def test_an_arm_weighs_what_its_data_sheet_says(name, base, weight, off):
    assert abs(load_robot(name).tree.mass.sum() + base - weight) < off * weight


@pytest.mark.parametrize(
    ("name", "frame", "height"),
    [
        ("iiwa14", "flange", 1.306),  # data sheet, with the flange of 126 mm
        ("gen3", "end_effector", 1.1874),  # user guide: 156.4 + 128.4 + 420.8 + 314.4 + 167.4 mm
        ("panda", "flange", 0.333 + 0.316 + 0.384 - 0.107),
    ],
)
def test_an_arm_at_zero_is_as_high_as_its_data_sheet_says(name, frame, height):
    assert_allclose(frame_pose(load_robot(name), frame, np.zeros(7))[2, 3], height, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "shoulder", "hand", "reach"),
    [
        ("iiwa14", "link_2", "link_6", 0.820),  # data sheet: reach to the wrist's centre
        ("gen3", "half_arm_1_link", "end_effector", 0.902),  # user guide: maximum reach
        ("ur10e", "upper_arm_link", "wrist_1_link", 0.6127 + 0.57155),
        ("ur5e", "upper_arm_link", "wrist_1_link", 0.425 + 0.3922),
    ],
)
def test_an_outstretched_arm_reaches_as_far_as_its_data_sheet_says(name, shoulder, hand, reach):
    model = load_robot(name)
    apart = np.linalg.inv(frame_pose(model, shoulder, np.zeros(model.n))) @ frame_pose(model, hand, np.zeros(model.n))
    # links lie beside each other: along the arm only, what stands across is the offset of its joints
    along = apart[0, 3] if name.startswith("ur") else np.linalg.norm(apart[:2, 3])
    assert_allclose(abs(along), reach, atol=1e-3)


@pytest.mark.parametrize("name", ARMS)
def test_every_motor_holds_its_own_arm_and_has_a_speed(name, rng):
    model = load_robot(name)
    lower, upper = np.clip(model.lower, -np.pi, np.pi), np.clip(model.upper, -np.pi, np.pi)
    q = rng.uniform(lower, upper, size=(2000, model.n))
    most = np.abs(gravity_torque(model, q, [0.0, 0.0, -STANDARD_GRAVITY])).max(axis=0)
    assert (most < model.effort_limit).all()
    assert np.isfinite(model.effort_limit).all()
    assert np.isfinite(model.velocity_limit).all()
