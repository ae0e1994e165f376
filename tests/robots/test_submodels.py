import re
from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.dynamics.kinematics import relative_pose
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.errors import CatenaryError, InputError
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify
from catenary.identification.identification_file import identification_card, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.robots.actuation import (
    Actuation,
    KnownTorque,
    LeverSpring,
    Spring,
    StatedDrive,
    actuation_terms,
    stated_actuation,
)
from catenary.robots.catalog import load_robot
from catenary.robots.shapes import load_geometry
from catenary.robots.submodels import cut_arm, lock_joints, on_base_joints
from catenary.robots.urdf_export import urdf_text
from catenary.spatial import quaternion_from_rotation
from command_line import catenary
from moving_arm import recorded
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order
from oracles.random_trees import random_robot, random_rotation


@pytest.mark.parametrize("seed", range(10))
def test_the_rest_of_a_locked_robot_moves_as_the_whole_one_does(seed):
    rng = np.random.default_rng(seed)
    model = random_robot(seed).model
    names = list(rng.permutation(model.joint_names))[: model.n // 2]
    values = {name: float(v) for name, v in zip(names, rng.uniform(-1.0, 1.0, len(names)), strict=True)}
    small = lock_joints(model, values)
    free = [k for k, name in enumerate(model.joint_names) if name not in values]
    q, qd, qdd = np.zeros((3, model.n))
    q[[model.joint_names.index(name) for name in values]] = list(values.values())
    own = rng.normal(size=(3, len(free)))
    q[free], qd[free], qdd[free] = own
    gravity = rng.normal(size=3) * 6.0
    whole = inverse_dynamics(model, q, qd, qdd, gravity)[free]
    assert_allclose(inverse_dynamics(small, *own, gravity), whole, atol=1e-9 * max(1.0, np.abs(whole).max()))
    assert len(small.link_names) <= len(model.link_names)
    for frame in model.frames:
        there, here = (relative_pose(m, at, frame, "base") for m, at in ((model, q), (small, own[0])))
        assert_allclose(here.position, there.position, atol=1e-10)
        assert_allclose(here.rotation, there.rotation, atol=1e-10)


def test_an_arm_cut_out_of_an_upper_body_holds_what_it_holds_there(rng):
    body = load_robot("dual_arm_19")
    trunk = [name for name in body.joint_names if body.coupling[:, body.joint_names.index(name)].any()][:3]
    base = body.link_names[2]
    bent = dict(zip(trunk, (0.2, -0.1, 0.3), strict=True))
    arm = cut_arm(body, base, "left_hand", locked=bent)
    assert (arm.n, arm.tip, arm.base) == (8, "left_hand", "base")
    q = np.zeros(body.n)
    q[[body.joint_names.index(name) for name in bent]] = list(bent.values())
    own = rng.normal(size=arm.n)
    free = [body.joint_names.index(name) for name in arm.joint_names]
    q[free] = own
    gravity = np.array([1.0, -2.0, -9.0])
    stands = relative_pose(body, q, base, "base")
    held = gravity_torque(arm, own, stands.rotation.T @ gravity)
    assert_allclose(held, gravity_torque(body, q, gravity)[free], atol=1e-10)
    there, here = relative_pose(body, q, "left_hand", base), relative_pose(arm, own, "left_hand", base)
    assert_allclose(here.position, there.position, atol=1e-12)


def test_springs_and_known_torques_go_on_from_where_the_locked_joints_stand(rng):
    arm, both = load_robot("ur10e"), np.array([0.0, 1.0, 0.6, 0.0, 0.0, 0.0])
    lever = Spring("balance", both, LeverSpring(0.1, 0.4, 0.2, 30.0))
    cable = KnownTorque(
        "cable", both, along=np.array([0.0, 1.0, 0.5, 0.0, 0.0, 0.2]), polynomial=np.array([2.0, -1, 3])
    )
    actuation = Actuation(springs=(lever,), known_torques=(cable,), values=np.array([50.0]))
    arm, q = replace(arm, actuation=actuation), rng.uniform(-1.0, 1.0, (20, 6))
    q[:, 2] = 0.8
    free, still = [0, 1, 3, 4, 5], np.zeros((20, 6))
    small = lock_joints(arm, {"elbow_joint": 0.8})
    whole = known_loads(arm).torque(q, still, still)[:, free]
    assert_allclose(known_loads(small).torque(q[:, free], still[:, free], still[:, free]), whole, atol=1e-12)
    linear = replace(arm, actuation=replace(actuation, springs=(Spring("coil", both),)))
    with pytest.raises(InputError, match='spring "coil" acts on free joints as well'):
        lock_joints(linear, {"elbow_joint": 0.8})


def test_friction_and_rotors_stay_with_their_joints():
    arm = load_robot("ur10e")
    drives = [StatedDrive(name, friction=k + 1.0, armature=0.1 * k) for k, name in enumerate(arm.joint_names)]
    arm = replace(arm, actuation=stated_actuation(arm.joint_names, drives))
    small = lock_joints(arm, {"elbow_joint": 1.0, "wrist_3_joint": 0.0})
    loads = known_loads(small)
    assert isinstance(loads, ActuationLoads)
    asked = loads.torque(*np.array([np.zeros(4), np.ones(4), np.ones(4)])[:, None, :])
    assert_allclose(asked[0], [1.0, 2.1, 4.3, 5.4])
    assert len(actuation_terms(small.actuation)) == len(small.actuation.values)


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        (lambda arm: lock_joints(arm, {"nose": 0.0}), 'lock: no joint "nose"; joints: shoulder_pan_joint'),
        (
            lambda arm: lock_joints(arm, {"elbow_joint": 40.0}),
            'joint "elbow_joint": 40 rad outside [-3.14159, 3.14159]',
        ),
        (lambda arm: lock_joints(arm, dict.fromkeys(arm.joint_names, 0.0)), "no joint is left that moves"),
        (lambda arm: cut_arm(arm, "tool0", "shoulder_link"), 'frame "shoulder_link" is not moved by joints on "tool0"'),
        (lambda arm: cut_arm(arm, "nose", "tool0"), 'no frame "nose"'),
    ],
)
def test_what_cannot_be_cut_is_refused(cut, said):
    with pytest.raises(InputError) as caught:
        cut(load_robot("ur10e"))
    assert said in str(caught.value)


FRICTION = '[[actuation.friction]]\nname = "f"\non = { elbow_joint = 2.0 }\n'


@pytest.fixture
def table(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_text(load_robot("ur10e")))

    def write(text, first='description = "arm.urdf"\n'):
        path = tmp_path / "arm.toml"
        path.write_text(first + text)
        return path

    return write


def test_a_table_beside_a_urdf_gives_it_actuation_a_name_and_a_tip(table):
    path = table(f'name = "mine"\ntip = "wrist_1_link"\n{FRICTION}')
    model = load_robot(path)
    assert (model.name, model.tip) == ("mine", "wrist_1_link")
    assert_allclose(model.actuation.friction[0].combination, [0, 0, 2, 0, 0, 0])
    assert [source.partition(",")[0] for source in model.sources[-2:]] == ["arm.urdf", "arm.toml"]
    assert load_geometry(path, model) is not None
    assert catenary("check", path).code == 0


def test_a_table_cuts_an_arm_out_of_its_description(table, rng):
    model = load_robot(table('base = "upper_arm_link"\ntip = "wrist_3_link"\n[locked_deg]\nwrist_2_joint = 30.0\n'))
    whole = load_robot(table(""))
    arm = cut_arm(whole, "upper_arm_link", "wrist_3_link", locked={"wrist_2_joint": np.pi / 6.0})
    assert model.joint_names == ("elbow_joint", "wrist_1_joint", "wrist_3_joint")
    q, gravity = rng.normal(size=3), rng.normal(size=3)
    assert_allclose(gravity_torque(model, q, gravity), gravity_torque(arm, q, gravity))


KINDS_OF_ORDER = ("urdf", "text", "described", "cut", "locked", "table", "identified", "mjcf", "written again")


@pytest.fixture
def in_another_order(tmp_path):
    """Return a robot of a kind, whose file lists c_hand, b_elbow, then a_waist, which carries d_other too."""
    mass = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    places = {"c_hand": ("b", "c"), "d_other": ("a", "d"), "b_elbow": ("a", "b"), "a_waist": ("root", "a")}
    limit = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>{limit}</joint>'
        for name, (parent, child) in places.items()
    )
    links = "".join(f'<link name="{name}">{mass}</link>' for name in ("root", *"abcd"))
    text = f'<robot name="r">{links}{joints}</robot>'
    (tmp_path / "arm.urdf").write_text(text)

    def nested(name, inside):
        return f'<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="{name}"/>{inside}</body>'

    inside = nested("d_other", "") + nested("b_elbow", nested("c_hand", ""))
    (tmp_path / "arm.xml").write_text(f"<mujoco><worldbody>{nested('a_waist', inside)}</worldbody></mujoco>")
    carriers = {child: name for name, (_, child) in places.items()} | {"root": "base"}
    rows = [  # hang on rows that come later, but for the last
        f'[[link]]\nname = "{name}"\njoint = "revolute"\nalpha_deg = 0\na_m = 0\nd_m = 0\ntheta_deg = 0\n'
        f'parent = "{carriers[parent]}"\n'
        for name, (parent, _) in places.items()
    ]
    (tmp_path / "rows.toml").write_text(f'name = "r"\nconvention = "modified"\nsources = []\n{"".join(rows)}')
    cut = 'description = "arm.urdf"\nbase = "root"\ntip = "c"\n'
    (tmp_path / "described.toml").write_text('description = "arm.urdf"\n')
    (tmp_path / "cut.toml").write_text(cut)
    (tmp_path / "locked.toml").write_text(f"{cut}locked_deg = {{ a_waist = 0 }}\n")

    def load(kind):
        if kind == "identified":
            robot, path = load_robot(tmp_path / "arm.urdf"), tmp_path / "arm.npz"
            found = identify([recorded(robot, 0)], robot, IdentifyOptions(prior=False, friction=()))
            save_identification(found, identification_card(found, []), path)
            return path
        if kind == "written again":
            (tmp_path / "again.urdf").write_text(urdf_text(load_robot(tmp_path / "arm.urdf")))
        files = {"urdf": "arm.urdf", "table": "rows.toml", "mjcf": "arm.xml", "written again": "again.urdf"}
        return text if kind == "text" else tmp_path / files.get(kind, f"{kind}.toml")

    return load


@pytest.mark.parametrize("kind", KINDS_OF_ORDER)
def test_joints_of_every_kind_of_robot_are_depth_first_and_a_note_says_what_its_file_does_not(
    kind, in_another_order, caplog
):
    source = in_another_order(kind)
    caplog.clear()
    model = load_robot(source)
    order = ("a_waist", "d_other", "b_elbow", "c_hand")
    order = {"cut": ("a_waist", "b_elbow", "c_hand"), "locked": ("b_elbow", "c_hand")}.get(kind, order)
    assert model.joint_names == order
    told = f"its joints are in the order {', '.join(order)}: depth first from the base, not as the file lists them"
    assert (told in caplog.text) == (kind not in ("mjcf", "written again"))
    if kind == "urdf":
        shown = catenary("fk", source, "--q", "0.1,0.2,0.3,0.4")
        assert told in shown.err.replace("\n", " ")


@pytest.mark.parametrize(
    ("text", "first", "said"),
    [
        (
            "",
            'description = "none.urdf"\n',
            'description "none.urdf": expected a .urdf, .xml, .mjcf, .json file beside it',
        ),
        ('tip = "nose"\n', None, 'no frame "nose"'),
        ("[locked_m]\nelbow_joint = 0.1\n", None, '"elbow_joint" is in rad: expected locked_deg for it'),
        (FRICTION.replace("elbow_joint", "elbow"), None, 'acts on unknown coordinate "elbow"'),
        ('tipp = "tool0"\n', None, "tipp"),
    ],
)
def test_a_table_that_does_not_fit_its_description_is_refused(table, text, first, said):
    path = table(text) if first is None else table(text, first)
    with pytest.raises(CatenaryError, match=re.escape(said)) as caught:
        load_robot(path)
    assert str(path) in str(caught.value)


_ORDER = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])  # theirs is (m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz)


@pytest.mark.parametrize("seed", range(20))
def test_regressor_on_base_joints_is_pinocchios_of_a_free_flyer(seed):
    rng, robot = np.random.default_rng(seed), random_robot(seed)
    m, peer = robot.model, pinocchio_model(robot, base="free")
    q, qd, qdd = rng.normal(size=(3, m.n))
    omega, alpha, acceleration, velocity, gravity = rng.normal(size=(5, 3)) * [[1], [3], [3], [1], [6]]
    R, order = random_rotation(rng), pinocchio_order(robot, peer)
    peer.gravity.linear = R @ gravity
    x, xd, xdd = np.zeros(peer.nq), np.zeros(peer.nv), np.zeros(peer.nv)
    x[3:7] = np.roll(quaternion_from_rotation(R), -1)
    x[order + 1], xd[order], xdd[order] = m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd
    # Pinocchio's acceleration is the spatial one: that of the origin as a point, less omega x velocity
    xd[:6], xdd[:6] = np.r_[velocity, omega], np.r_[acceleration - np.cross(omega, velocity), alpha]
    theirs = pinocchio.computeJointTorqueRegressor(peer, peer.createData(), x, xd, xdd).reshape(peer.nv, -1)
    held, still = on_base_joints(m), np.zeros(6)
    base = BaseMotion(omega, alpha, acceleration, velocity)
    ours = torque_regressor(held, *(np.r_[still, rate] for rate in (q, qd, qdd)), gravity, base)
    # the base's body and each link; their joints count from the free flyer, which has six rates
    bodies = np.concatenate([_ORDER, *(10 * (k - 5) + _ORDER for k in order)])
    assert_allclose(ours[:6, 50:], theirs[:6, bodies], rtol=1e-10, atol=1e-10)
    assert_allclose(ours[6:, 50:], m.coupling.T @ theirs[np.ix_(order, bodies)], rtol=1e-10, atol=1e-10)
