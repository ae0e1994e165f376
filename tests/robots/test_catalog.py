from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_open, load_robot, robot_names
from catenary.robots.model import Tree
from catenary.robots.urdf_export import urdf_text
from catenary.spatial import STANDARD_GRAVITY
from oracles.dh_products import standard
from oracles.tree_poses import frame_pose, potential_energy

HOME = [np.deg2rad(30), np.deg2rad(90), 0.40, 0.0, 0.0, 0.0]
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize("name", robot_names())
def test_every_robot_loads_and_states_its_sources(name):
    model = load_robot(name)
    assert model.name == name
    assert model.sources
    assert all(len(source) > 10 for source in model.sources)
    assert (model.lower < model.upper).all()
    assert not model.doubts  # every inertia is that of a body that can exist


@pytest.mark.parametrize("name", ["dvrk_psm_motors", "dvrk_psm", "dvrk_mtm_motors", "dvrk_mtm", "dvrk_ecm", "tiago"])
def test_robots_without_published_inertia_are_kinematics_only(name):
    model = load_robot(name)
    assert model.missing_inertia == model.link_names
    with pytest.raises(MissingInertiaError, match=f'"{model.link_names[0]}"'):
        gravity_torque(model, np.zeros(model.n), [0.0, 0.0, -9.81])


def test_both_masters_are_the_same_arm_in_other_coordinates(rng):
    motor, joint = load_robot("dvrk_mtm_motors"), load_robot("dvrk_mtm")
    turned = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.2154], [0.0, 0.0, 0.0, 1.0]])
    for q in rng.normal(size=(10, 7)):
        own = [q[0], q[1], q[2] - q[1], 0.6697 * (q[1] - q[2]) + q[3], *q[4:]]
        for name in motor.link_names:
            # the dVRK has its own base, and a platform that is 0.4 mm shorter
            assert_allclose(turned @ frame_pose(motor, name, q), frame_pose(joint, name, own), atol=4.1e-4)


def test_the_psms_shaft_always_passes_one_point_on_the_first_axis(rng):
    model = load_robot("dvrk_psm_motors")
    first = frame_pose(model, "yaw", np.zeros(7))
    remote_centre = first[:3, 3] - 0.516 * first[:3, 2]  # the length of the parallelogram's top bar
    for q in rng.uniform(-0.7, 0.7, size=(10, 7)):
        shaft = frame_pose(model, "insertion", q)
        assert_allclose(np.cross(shaft[:3, 3] - remote_centre, shaft[:3, 2]), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "mass"),
    [
        *((name, 0.494 + 0.750 + 0.231) for name in robot_names() if name.startswith("raven2")),
        ("two_link", 2.0),
        ("planar_3r", 4.5),
        ("dual_arm_19", 62.0),
    ],
)
def test_masses_add_up_to_the_sources(name, mass):
    model = load_robot(name)
    model.require_inertia()
    assert_allclose(model.tree.mass.sum(), mass)


@pytest.mark.parametrize(("short", "full"), [("raven2", "raven2_full"), ("raven2_right", "raven2_full_right")])
def test_ravens_three_joints_are_the_first_of_its_six(short, full):
    three, six = load_robot(short), load_robot(full)
    for field in ("mass", "com", "inertia", "rotation", "origin"):
        assert_array_equal(getattr(three.tree, field), getattr(six.tree, field)[:3])
    assert_array_equal(three.upper, six.upper[:3])
    wrist = frame_pose(three, "wrist", HOME[:3])
    assert_allclose(wrist, frame_pose(six, "roll", HOME), atol=1e-15)


@pytest.mark.parametrize(("name", "lengths"), [("two_link", (1.0, 0.5)), ("planar_3r", (0.4, 0.3, 0.2))])
def test_a_planar_arms_hand_is_where_its_angles_put_it(name, lengths):
    q = np.array([0.3, 0.5, -1.1])[: len(lengths)]
    along = np.exp(1j * np.cumsum(q)) @ lengths
    hand = frame_pose(load_robot(name), None, q)[:3, 3]
    assert_allclose(hand, [along.real, 0.0, along.imag], atol=1e-15)


URDF = (
    '<robot name="u"><link name="w"/><link name="a"/><joint name="j" type="continuous"><parent link="w"/>'
    '<child link="a"/></joint></robot>'
)
TABLE = (
    'name = "t"\nconvention = "standard"\nsources = []\n[[link]]\nname = "a"\njoint = "revolute"\n'
    "alpha_deg = 0\na_m = 0\nd_m = 0\ntheta_deg = 0\nmassless = true\n"
)
MJCF = '<mujoco model="m"><worldbody><body name="a"><joint name="j"/><geom size="1"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("file", "text", "name"),
    [
        ("r.urdf", URDF, "u"),
        ("r.xml", URDF, "u"),
        ("r.URDF", URDF, "u"),
        ("r.xml", MJCF, "m"),
        ("r.mjcf", MJCF, "m"),
        ("r.toml", TABLE, "t"),
    ],
)
def test_a_file_is_read_by_what_it_holds(tmp_path, file, text, name):
    path = tmp_path / file
    path.write_text(text)
    model = load_robot(str(path), massless=["a"] if text is URDF else [])
    assert model.name == name
    assert model.missing_inertia == ()


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("r.sdf", "<sdf/>", 'ending ".sdf": expected .toml, .urdf, .xml, .mjcf, .json or .npz'),
        ("r.xml", "<sdf/>", "root element <sdf>: expected <robot> (URDF) or <mujoco> (MJCF)"),
        ("r.xml", "", "cannot be read as XML: no element found"),
        ("r.xml", "robot", "cannot be read as XML: syntax error"),
    ],
)
def test_a_file_of_another_kind_is_refused(tmp_path, file, text, said):
    path = tmp_path / file
    path.write_text(text)
    with pytest.raises(FileFormatError) as caught:
        load_robot(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")


def test_what_is_no_robot_is_refused_with_the_catalogue(tmp_path):
    with pytest.raises(FileFormatError, match=r'"raven": .*did you mean "raven2"\?.*planar_3r, puma560, raven2, '):
        load_robot("raven")
    with pytest.raises(FileFormatError, match=r'did you mean "dvrk_psm"\?'):
        load_robot("dvrk_psm_joint")
    with pytest.raises(FileFormatError, match="neither a file nor in the catalogue"):
        load_robot(tmp_path)
    with pytest.raises(FileFormatError, match=r"none\.urdf: no such file"):
        load_open(tmp_path / "none.urdf")


# the dual-arm robot: what the gravity-regressor paper says of it, and that its halves mirror each other

DUAL = load_robot("dual_arm_19")
ARM = ["clavicle", "shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_yaw", "wrist_pitch", "wrist_roll"]
# rotations about the forward and the vertical axis change sign in a mirror, those about the lateral one do not
FLIP = {"pitch": 1.0, "elbow": 1.0, "clavicle": -1.0, "roll": -1.0, "yaw": -1.0}


def dual_mirrored(q):
    """The same posture seen in a mirror."""
    at = {name: k for k, name in enumerate(DUAL.joint_names)}
    out = np.empty(19)
    for name, k in at.items():
        other = name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        out[at[other]] = q[k] * FLIP[name.split("_")[-1]]
    return out


def test_dual_arm_has_three_joints_in_the_trunk_and_eight_in_each_arm():
    trunk = ("trunk_yaw", "trunk_pitch", "trunk_roll")
    assert DUAL.joint_names == (*trunk, *(f"{side}_{joint}" for side in ("left", "right") for joint in ARM))
    assert set(DUAL.joint_units) == {"rad"}


def test_dual_arm_stands_a_metre_high_with_hanging_arms():
    zero = np.zeros(19)
    assert_allclose(frame_pose(DUAL, "head", zero)[:3, 3], [0, 0, 1.0], atol=1e-12)
    for side, y in (("left", 0.2), ("right", -0.2)):
        assert_allclose(frame_pose(DUAL, f"{side}_hand", zero)[:3, 3], [0, y, 0.07], atol=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_dual_arm_reaches_065_m_and_no_further(side, rng):
    reach = []
    for k in range(200):
        q = rng.uniform(DUAL.lower, DUAL.upper) if k else np.zeros(19)
        hand, shoulder = (frame_pose(DUAL, f"{side}_{name}", q)[:3, 3] for name in ("hand", "shoulder_roll"))
        reach.append(np.linalg.norm(hand - shoulder))
    assert_allclose(max(reach), 0.65, atol=1e-12)


def test_dual_arms_mirror_each_other(rng):
    for _ in range(20):
        q = rng.uniform(DUAL.lower, DUAL.upper)
        expected = MIRROR @ frame_pose(DUAL, "left_hand", q) @ MIRROR
        assert_allclose(frame_pose(DUAL, "right_hand", dual_mirrored(q))[:3, 3], expected[:3, 3], atol=1e-14)
        assert_allclose(
            potential_energy(DUAL, dual_mirrored(q), [0, 0, -9.81]), potential_energy(DUAL, q, [0, 0, -9.81])
        )


def test_dual_arms_limits_mirror_each_other():
    low, high = dual_mirrored(DUAL.lower), dual_mirrored(DUAL.upper)
    assert_allclose(np.minimum(low, high), DUAL.lower)
    assert_allclose(np.maximum(low, high), DUAL.upper)


def test_a_robots_text_is_the_robot_in_its_file_as_ros_hands_it_over(tmp_path):
    text = f"<?xml version='1.0'?>\n{urdf_text(load_robot('raven2'))}".replace('<?xml version="1.0"?>\n', "")
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    from_text, from_file = load_robot(text), load_robot(path)
    for key in Tree._fields:
        assert_array_equal(getattr(from_text.tree, key), getattr(from_file.tree, key))
    assert from_text.sources[0].startswith("text, sha256 ")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco/>", "robot description: is MJCF"),
        ("  <robot name='a'", "robot description: "),
        ("<html></html>", "robot description: root element <html>, expected <robot>"),
        (" <robot>" + " " * 40_000_000, "robot description: 40000008 bytes, expected at most"),
    ],
)
def test_a_text_that_is_no_urdf_is_refused_as_a_description(text, said):
    with pytest.raises(FileFormatError) as caught:
        load_robot(text)
    assert said in str(caught.value)


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


@pytest.fixture(params=[*UR, Path(__file__).parents[2] / "examples" / "ur5e.urdf"], ids=str)
def universal(request):
    """A robot, the pose of its maker's base, and the maker's table."""
    model = load_robot(request.param)
    base = frame_pose(model, "base", np.zeros(6)) if "base" in model.frames else np.eye(4)
    return model, base, UR[Path(request.param).stem]


def test_a_universal_robot_stands_where_its_makers_standard_table_puts_it(universal, rng):
    model, base, (a, d, _, _) = universal
    for q in rng.uniform(-np.pi, np.pi, size=(20, 6)):
        assert_allclose(frame_pose(model, None, q), base @ standard_poses(a, d, q)[-1], atol=1e-12)


def test_a_universal_robots_gravity_is_the_gradient_of_energy_by_its_makers_table(universal, rng):
    model, base, (a, d, masses, coms) = universal

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
