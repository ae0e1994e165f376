import hashlib
import re
import sys
from types import SimpleNamespace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import own_base
from catenary.dynamics.kinematics import relative_pose
from catenary.errors import (
    CatenaryError,
    FileFormatError,
    InputError,
    MissingInertiaError,
    MissingPackageError,
    UnsupportedModelError,
)
from catenary.robots.actuation import joint_drives
from catenary.robots.catalog import load_robot
from catenary.robots.shapes import described_geometry
from catenary.robots.urdf import load_urdf, load_xacro, parse_urdf
from command_line import catenary
from oracles.random_robots import random_urdf
from oracles.tree_poses import all_links, frame_pose

ALL_KINDS = ("revolute", "fixed", "prismatic", "continuous", "revolute")
INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


def joint(name, parent, child, kind="revolute", inside=LIMIT):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def urdf(*parts, links=("root", "a", "b", "c")):
    return (
        "<robot name='r'>"
        + "".join(f"<link name='{link}'>{INERTIAL}</link>" for link in links)
        + "".join(parts)
        + "</robot>"
    )


ONE = joint("j", "root", "a")


def one_joint(inside, kind="revolute"):
    return urdf(joint("j", "root", "a", kind, inside), links=("root", "a"))


def pinocchio_state(model, ours, q):
    """Pinocchio's q: its own order, and (cos, sin) for continuous joints."""
    state = pin.neutral(model)
    for name, value in zip(ours.joint_names, q, strict=True):
        there = model.joints[model.getJointId(name)]
        state[there.idx_q : there.idx_q + there.nq] = value if there.nq == 1 else [np.cos(value), np.sin(value)]
    return state


@pytest.mark.parametrize("seed", range(6))
def test_link_poses_and_folded_inertias_agree_with_pinocchio(seed):
    """A tree for even seeds, a chain with mimic joints for odd ones."""
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, kinds=ALL_KINDS, mimics=[(4, 2), (7, 2)] if seed % 2 else [], count=9)
    ours, theirs = parse_urdf(text), pin.buildModelFromXML(text, True)
    data = theirs.createData()
    for _ in range(5):
        q = rng.uniform(-2, 2, ours.n)
        pin.framesForwardKinematics(theirs, data, pinocchio_state(theirs, ours, q))
        for link in all_links(ours):
            expected = data.oMf[theirs.getFrameId(link)].homogeneous
            assert_allclose(frame_pose(ours, link, q), expected, atol=1e-11)  # nine products of metres
    for number, link in enumerate(ours.link_names):
        there = theirs.inertias[theirs.getJointId(link.replace("link", "joint"))]
        assert_allclose(ours.tree.mass[number], there.mass, rtol=1e-12)
        assert_allclose(ours.tree.com[number], there.lever, atol=1e-12)
        assert_allclose(ours.tree.inertia[number], there.inertia, atol=1e-11)


def test_coordinates_come_from_base_to_tip_without_mimic_joints():
    text = urdf(
        joint("last", "b", "c"),
        joint("follower", "a", "b", inside='<mimic joint="last"/>' + LIMIT),
        joint("first", "root", "a"),
    )
    assert parse_urdf(text).joint_names == ("first", "last")
    assert parse_urdf(text).file_order == ("last", "first")


@pytest.mark.parametrize("seed", range(6))
def test_joints_of_a_file_in_any_order_stand_as_mujoco_orders_them(seed):
    rng = np.random.default_rng(seed)
    written = random_urdf(rng, kinds=("revolute", "prismatic"))
    parts = re.findall(r'<link name="root"/>|<link .*?</link>|<joint .*?</joint>', written)
    text = f"<robot name='r'>{''.join(rng.permutation(parts))}</robot>"
    theirs = mujoco.MjModel.from_xml_string(text)
    ours = parse_urdf(text)
    assert ours.joint_names == tuple(theirs.joint(k).name for k in range(theirs.njnt))
    assert ours.file_order == tuple(re.findall(r'<joint name="(\w+)"', text))
    assert ours.link_names == tuple(name.replace("joint", "link") for name in ours.joint_names)


def test_limits_are_read_and_a_continuous_joint_has_no_position_limit():
    model = parse_urdf(
        urdf(
            ONE,
            joint("slide", "a", "b", "prismatic", '<limit upper="0.5" velocity="1" effort="2"/>'),
            joint("turn", "b", "c", "continuous", '<limit lower="-1" upper="1" velocity="5" effort="6"/>'),
        )
    )
    assert_array_equal(parse_urdf(one_joint("", "continuous")).effort_limit, [np.inf])
    assert_array_equal(model.lower, [-1, 0, -np.inf])
    assert_array_equal(model.upper, [2, 0.5, np.inf])
    assert_array_equal(model.velocity_limit, [3, 1, 5])
    assert_array_equal(model.effort_limit, [4, 2, 6])
    assert model.joint_units == ("rad", "m", "rad")


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e200])
def test_an_axis_of_any_length_is_a_direction_and_x_where_none_is_given(size):
    assert_array_equal(parse_urdf(one_joint(LIMIT)).tree.axis, [[1, 0, 0]])
    axis = f'<axis xyz="0 {3 * size} {4 * size}"/>'
    assert_allclose(parse_urdf(one_joint(LIMIT + axis)).tree.axis, [[0, 0.6, 0.8]], rtol=1e-14)


@pytest.mark.parametrize("text", ["1_000", "\u0661", "\uff11"])
@pytest.mark.parametrize("where", ['mass value="2"', 'ixx="1"', 'lower="-1"', 'xyz="0 3 4"', "<motorInertia>1"])
def test_numbers_that_xml_has_not_are_refused(text, where):
    drive = "<mechanicalReduction>2</mechanicalReduction><motorInertia>1</motorInertia>"
    robot = one_joint(LIMIT + '<axis xyz="0 3 4"/>').replace(
        "</robot>",
        f'<transmission name="t"><joint name="j"/><actuator name="m">{drive}</actuator></transmission></robot>',
    )
    parse_urdf(robot)
    with pytest.raises(FileFormatError, match=r"expected .*number"):
        parse_urdf(robot.replace(where, re.sub(r"\d", text, where, count=1)))


def test_a_chain_of_mimic_joints_follows_its_free_end():
    model = parse_urdf(
        urdf(
            joint("x", "root", "a", inside='<mimic joint="y" multiplier="2" offset="0.1"/>' + LIMIT),
            joint("y", "a", "b", inside='<mimic joint="z" multiplier="-3" offset="0.5"/>' + LIMIT),
            joint("z", "b", "c"),
        )
    )
    # y = -3 z + 0.5, x = 2 y + 0.1 = -6 z + 1.1
    assert model.joint_names == ("z",)
    assert_allclose(model.coupling, [[-6], [-3], [1]])
    assert_allclose(model.offset, [1.1, 0.5, 0])


def test_an_origin_may_be_a_quaternion():
    model = parse_urdf(one_joint(LIMIT + '<origin xyz="1 2 3" quat_xyzw="1 0 0 1"/>'))
    assert_allclose(model.tree.rotation[0], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)


def test_the_root_link_is_the_base_and_stays_a_frame():
    model = parse_urdf(one_joint(LIMIT))
    assert_array_equal(frame_pose(model, "root", [0.3]), np.eye(4))
    assert model.tree.mass.sum() == 2.0  # the root's own mass plays no part


def test_a_root_named_base_is_the_base():
    model = parse_urdf(urdf(joint("j", "base", "a"), links=("base", "a")))
    assert (set(model.frames), model.base, model.notes) == ({"base", "a"}, "base", ())


@pytest.mark.parametrize("text", [own_base.URDF, own_base.MOVING], ids=["fixed", "moving"])
def test_a_link_named_base_that_is_not_the_root_keeps_its_name_and_place(text, caplog):
    model = parse_urdf(text)
    q = np.array([0.3, -0.7])
    expected = own_base.poses(text, q)
    assert set(model.frames) == set(expected)
    assert model.base == "base_link"
    for frame in model.frames:
        theirs = expected["base"].actInv(expected[frame]).homogeneous
        pose = relative_pose(model, q, frame, "base")
        assert_allclose(pose.rotation, theirs[:3, :3], atol=1e-12)
        assert_allclose(pose.position, theirs[:3, 3], atol=1e-12)
        assert_allclose(frame_pose(model, frame, q), expected[frame].homogeneous, atol=1e-12)
    assert '"base_link" is the base frame' in caplog.text
    assert any('"base_link" is the base frame' in note for note in model.notes)


def test_a_link_named_base_that_lies_on_the_root_needs_no_note(caplog):
    text = urdf(joint("f", "root", "base", "fixed", ""), joint("j", "base", "a"), links=("root", "base", "a"))
    model = parse_urdf(text)
    assert (model.base, model.notes, caplog.text) == ("base", (), "")


def test_moving_links_without_mass_are_missing_inertia_unless_something_fixed_to_them_has_some():
    shape = "<visual><geometry><box size='1 1 1'/></geometry></visual>"
    bare = f"<link name='d'/><link name='e'>{shape}</link><link name='f'/>"
    text = urdf(
        ONE, joint("jd", "a", "d"), joint("jb", "d", "b", "fixed", ""), joint("je", "b", "e"), joint("jf", "e", "f"), bare,
        links=("root", "a", "b"),
    )  # fmt: skip
    model = parse_urdf(text)
    assert model.missing_inertia == ("e", "f")  # e has a shape, f ends the arm
    with pytest.raises(MissingInertiaError, match='"e", "f"'):
        model.require_inertia()
    for massless in (["e", "f"], "all"):
        declared = parse_urdf(text, massless=massless)
        declared.require_inertia()
        assert declared.massless == ("e", "f")


def test_an_empty_link_that_carries_a_moving_joint_is_a_step_of_a_joint_of_several_axes():
    text = urdf(ONE, joint("jd", "a", "d"), joint("jb", "d", "b"), "<link name='d'/>", links=("root", "a", "b"))
    model = parse_urdf(text)
    model.require_inertia()
    assert model.massless == ("d",)
    assert model.doubts == ()


def test_a_mass_that_a_file_says_is_zero_is_zero_with_a_warning_or_refused(caplog):
    text = urdf(ONE, links=("root", "a")).replace('value="2"', 'value="0"')
    model = parse_urdf(text)
    model.require_inertia()
    assert model.massless == ("a",)
    assert 'link "a": has no mass, as the file says' in caplog.text
    with pytest.raises(InputError, match='robot "r": link "a": has no mass, as the file says'):
        load_robot(text, strict=True)
    assert load_robot(text, strict=True, massless=["a"]).massless == ("a",)


def test_a_link_without_an_inertia_tensor_has_its_mass():
    text = re.sub("<inertia .*?/>", "", urdf(ONE, links=("root", "a")))
    model = parse_urdf(text)
    assert model.missing_tensor == ("a",)
    assert model.tree.mass[0] == 2.0
    with pytest.raises(InputError, match='link "a": has a mass but no inertia'):
        load_robot(text, strict=True)


def test_what_is_left_out_is_said_with_the_joints_names():
    text = urdf(
        joint("p", "root", "a", inside=LIMIT + '<dynamics damping="0.5" friction="0.0"/>'),
        joint("q", "a", "b", inside=LIMIT + '<dynamics friction="1"/><calibration rising="0"/><safety_controller k_velocity="1"/>'),
        joint("z", "b", "c", inside='<limit velocity="0" effort="0"/>'),
        '<transmission name="t"><joint name="p"/></transmission><gazebo/><gazebo/>',
    )  # fmt: skip
    assert parse_urdf(text).notes == (
        "left out: calibration positions (q)",
        "left out: soft limits (q)",
        "velocity limit is 0 in the file (z)",
        "effort limit is 0 in the file (z)",
        "lower and upper limit are equal in the file (z)",
        "left out: elements (<gazebo>)",
        "left out: transmissions that state no rotor (p)",
    )


def test_a_mimic_joint_with_tighter_limits_than_its_leader_is_noted():
    follower = '<mimic joint="j" multiplier="2"/>'
    tight, loose = LIMIT, '<limit lower="-2" upper="4" velocity="1" effort="1"/>'
    for limit, noted in ((tight, True), (loose, False)):
        model = parse_urdf(urdf(ONE, joint("k", "a", "b", inside=follower + limit), links=("root", "a", "b")))
        assert any("tighter than their leader's (k)" in note for note in model.notes) == noted


def test_sources_give_the_files_name_and_hash(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(one_joint(LIMIT))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert load_urdf(path).sources == (f"arm.urdf, sha256 {digest}",)


MIMIC = '<mimic joint="{}"/>' + LIMIT
DAMAGED = [
    ("<robot", FileFormatError, "cannot be read as XML"),
    ("<mujoco/>", FileFormatError, "root element <mujoco>, expected <robot>"),
    ("<robot/>", FileFormatError, "no <link>, expected at least one"),
    ('<robot><link/></robot>', FileFormatError, "<link> number 1: no name"),
    (urdf(ONE, links=("root", "a", "a")), FileFormatError, 'two <link> elements are named "a"'),
    (urdf(ONE, joint("j", "a", "b"), links=("root", "a", "b")), FileFormatError, 'two <joint> elements are named "j"'),
    (urdf(ONE), FileFormatError, "several root links: root, b, c; expected one"),
    (urdf(joint("j", "root", "x")), FileFormatError, 'joint "j": <child> is unknown link "x"; links: root, a'),
    (urdf("<joint name='j' type='fixed'><parent link='a'/></joint>"), FileFormatError, 'joint "j": no <child link'),
    (urdf(ONE, joint("k", "a", "b"), joint("l", "root", "b"), links=("root", "a", "b")), UnsupportedModelError,
     'link "b" has two parents, by joints "k" and "l": a loop'),
    (urdf(joint("j", "a", "b"), joint("k", "b", "a"), links=("a", "b")), UnsupportedModelError, "every link has a parent"),
    (one_joint("", "floating"), UnsupportedModelError, 'joint "j": type "floating": a joint here has one'),
    (one_joint("", "ball"), FileFormatError, 'joint "j": type "ball", expected revolute, continuous'),
    (one_joint(""), FileFormatError, 'joint "j": type revolute without <limit>'),
    (one_joint('<limit effort="1"/>'), FileFormatError, 'joint "j": <limit>: velocity is missing, expected a number'),
    (one_joint(LIMIT + '<axis xyz="0 0"/>'), FileFormatError, 'joint "j": <axis>: xyz="0 0", expected 3 numbers'),
    (one_joint(LIMIT + '<origin xyz="0 0 nan"/>'), FileFormatError, 'joint "j": <origin>: xyz="0 0 nan", expected 3 numbers, finite'),
    (one_joint(LIMIT + '<origin quat_xyzw="0 0 0 0"/>'), FileFormatError, "quat_xyzw is zero"),
    (one_joint(LIMIT + '<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>'), FileFormatError, "expected one of the two"),
    (one_joint(MIMIC.format("x")), FileFormatError, 'joint "j": <mimic> follows "x", which is not a moving joint; moving joints: j'),
    (one_joint("<mimic/>" + LIMIT), FileFormatError, 'joint "j": <mimic> names no joint'),
    (one_joint(LIMIT + '<dynamics damping="-1"/>'), FileFormatError, 'joint "j": <dynamics>: damping -1, expected zero or more'),
    (one_joint(LIMIT + '<dynamics friction="much"/>'), FileFormatError, 'joint "j": <dynamics>: friction="much", expected a number'),
    (urdf(joint("j", "root", "a", inside=MIMIC.format("k")), joint("k", "a", "b", inside=MIMIC.format("j")), links=("root", "a", "b")),
     UnsupportedModelError, 'joint "j" follows itself: j -> k -> j'),
    (urdf(ONE, links=("root", "a")).replace('<mass value="2"/>', ""), FileFormatError, "<inertial>: no <mass>; expected one"),
    ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="x"/></robot>', FileFormatError, "is a xacro file"),
    ('<robot xmlns:x="http://www.ros.org/wiki/xacro"><x:arm/></robot>', FileFormatError, "is a xacro file"),
    (urdf(ONE, links=("root", "a")).replace("inertial>", "u:inertial>"), FileFormatError, "<u:inertial>, expected <inertial>"),
    (one_joint(LIMIT + '<u:origin xyz="1 0 0"/>'), FileFormatError, "<u:origin>, expected <origin>"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "error", "said"), DAMAGED, ids=[said[:40] for _, _, said in DAMAGED])
def test_a_damaged_file_is_refused_by_file_and_element(text, error, said, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(error) as caught:
        load_urdf(path)
    assert said in str(caught.value)
    assert type(caught.value) is error
    assert str(caught.value).startswith(f"{path}: ")


def test_a_mimic_on_a_fixed_joint_moves_nothing():
    text = urdf(ONE, joint("f", "a", "b", "fixed", '<mimic joint="j"/>'), links=("root", "a", "b"))
    assert parse_urdf(text).joint_names == ("j",)


# as in the Fetch's own file
GAZEBO = "<gazebo><sensor:camera name='eye'><body:pose/></sensor:camera></gazebo>"
NAMESPACES = {
    "undeclared prefix": (urdf(ONE, GAZEBO, links=("root", "a")), "(sensor:camera, body:pose)"),
    "default namespace": (
        urdf(ONE, links=("root", "a")).replace("<robot", "<robot xmlns='http://www.ros.org'"), "http://www.ros.org"
    ),
    "attributes with a prefix": (one_joint(LIMIT.replace("<limit", "<limit drake:acceleration='5'")), "(drake:acceleration)"),
    "elements with a prefix": (one_joint(LIMIT + "<drake:gear_ratio value='9'/>"), "(drake:gear_ratio)"),
    "declared and unused": (
        urdf(ONE, links=("root", "a")).replace("<robot", "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'"), None
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", NAMESPACES)
def test_namespaces_are_passed_over_as_pinocchio_does_and_said(kind, tmp_path):
    text, said = NAMESPACES[kind]
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    for model in (load_robot(path), load_robot(text)):
        peer = pin.buildModelFromXML(text)
        place = peer.createData()
        pin.framesForwardKinematics(peer, place, np.array([0.7]))
        theirs = place.oMf[peer.getFrameId("a", pin.FrameType.BODY)].homogeneous
        assert_allclose(frame_pose(model, "a", [0.7]), theirs, atol=1e-12)
        assert_allclose(model.tree.mass, [peer.inertias[1].mass])
        assert (said is None and not model.notes) or any(said in note for note in model.notes)


DYNAMICS = '<dynamics damping="0.5" friction="0.25"/>'
SRDF = '<robot name="r"><rotor_params><joint name="j" mass="1e-4" gear_ratio="-100"/></rotor_params></robot>'


@pytest.mark.parametrize("name", ["arm.srdf", "r.srdf"])
def test_friction_and_rotors_are_pinocchios(tmp_path, name):
    folder = tmp_path / "urdf"
    folder.mkdir()
    (tmp_path / "srdf").mkdir()
    path, beside = folder / "arm.urdf", tmp_path / "srdf" / name
    path.write_text(urdf(joint("j", "root", "a", inside=LIMIT + DYNAMICS), links=("root", "a")))
    beside.write_text(SRDF)
    theirs = pin.buildModelFromUrdf(str(path))
    pin.loadRotorParameters(theirs, str(beside), False)
    ours = load_urdf(path)
    drives = joint_drives(ours.actuation, 1)
    assert drives.friction == theirs.friction == 0.25
    assert drives.damping == theirs.damping == 0.5
    assert_allclose(drives.armature, theirs.rotorInertia * theirs.rotorGearRatio**2)
    assert [source.partition(",")[0] for source in ours.sources] == ["arm.urdf", name]


ROS = "<mechanicalReduction>50</mechanicalReduction><motorInertia>2e-4</motorInertia>"
DRAKE = '<drake:gear_ratio value="50"/><drake:rotor_inertia value="2e-4"/>'


@pytest.mark.parametrize(
    ("inside", "rotor"), [(ROS, 0.5), (DRAKE, 0.5), ("<mechanicalReduction>50</mechanicalReduction>", None)]
)
def test_a_rotor_is_reflected_by_the_square_of_its_gear(inside, rotor):
    transmission = f'<transmission name="t"><joint name="j"/><actuator name="m">{inside}</actuator></transmission>'
    follower = joint("k", "a", "b", inside=LIMIT + '<mimic joint="j" multiplier="-2"/>')
    model = parse_urdf(urdf(ONE, follower, transmission, links=("root", "a", "b")))
    if rotor is None:
        assert model.actuation is None
        assert model.notes[-1] == "left out: transmissions that state no rotor (j)"
    else:
        assert_allclose(joint_drives(model.actuation, 1).armature, rotor)
        behind = parse_urdf(urdf(ONE, follower, transmission.replace('"j"', '"k"'), links=("root", "a", "b")))
        assert_allclose(joint_drives(behind.actuation, 1).armature, 4.0 * rotor)


URDF = """<robot name="expanded"><link name="root"/><link name="a"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0"
iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j" type="continuous"><parent link="root"/><child link="a"/></joint></robot>"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)  # not importable
    path = tmp_path / "arm.urdf.xacro"
    path.write_text("<robot/>")
    return path


def test_xacro_that_is_not_installed_is_asked_for(file):
    with pytest.raises(MissingPackageError, match="is a xacro file, and xacro is not installed: pip install xacro"):
        load_xacro(file)


def test_the_package_expands_it_or_says_why_not(file, monkeypatch):
    document = SimpleNamespace(toxml=lambda: URDF)
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: document))
    made = load_xacro(file)
    assert (made.name, made.joint_names) == ("expanded", ("j",))
    assert made.sources[0].startswith("arm.urdf.xacro, sha256 ")
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: 1 / 0))
    with pytest.raises(FileFormatError, match="xacro cannot expand it: division by zero"):
        load_xacro(file)


def test_nothing_expands_xacro_unasked(file, monkeypatch):
    """Not load_robot, shapes, commands or a table that names it: its expressions are Python."""
    ran = []
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: ran.append(name)))
    table = file.with_name("table.toml")
    table.write_text(f'description = "{file.name}"\n')
    for source in (file, table):
        with pytest.raises(CatenaryError, match=r"is a xacro file: expanding it runs the Python|expected a \.urdf"):
            load_robot(source)
        catenary("check", source)
        assert catenary("gravity", source, "--q", "0").code == 2
    assert described_geometry(file, load_robot("two_link")) is None
    assert not ran


def test_a_command_expands_xacro_when_asked(file, monkeypatch):
    document = SimpleNamespace(toxml=lambda: URDF)
    monkeypatch.setitem(sys.modules, "xacro", SimpleNamespace(process_file=lambda name: document))
    asked = catenary("gravity", file, "--xacro", "--q", "0.3")
    assert asked.code == 0, asked
