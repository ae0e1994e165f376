import hashlib
import sys

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import own_base
from catenary.dynamics.actuation_loads import known_loads
from catenary.errors import FileFormatError, MissingInertiaError, MissingPackageError, UnsupportedModelError
from catenary.robots.mjcf import load_mjcf
from oracles.random_robots import random_mjcf
from oracles.tree_poses import frame_pose, homogeneous, link_poses, moments_about_origin

BALL_GEOM = '<geom size="0.1" mass="1"/>'
ARM = f"""
<mujoco model="arm"><compiler angle="radian"/><worldbody>
  <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" {{first}}/>{BALL_GEOM}
    <body name="lower" pos="1 0 0"><joint name="elbow" axis="0 1 0" {{second}}/>{BALL_GEOM}
      <body name="hand" pos="1 0 0"><joint name="wrist" axis="1 0 0"/>{BALL_GEOM}</body>
    </body>
  </body>
</worldbody>{{rest}}</mujoco>"""


def arm(first="", second="", rest=""):
    return ARM.format(first=first, second=second, rest=rest)


def worldbody(*parts, rest=""):
    return f'<mujoco><compiler angle="radian"/><worldbody>{"".join(parts)}</worldbody>{rest}</mujoco>'


@pytest.fixture
def load(tmp_path):
    """Load a text as a file called robot.xml."""

    def load_text(text, **options):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        return load_mjcf(path, **options)

    return load_text


def mujoco_at(text, names, q):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, value in zip(names, q, strict=True):
        data.joint(name).qpos = value
    mujoco.mj_kinematics(model, data)
    return model, data


@pytest.mark.parametrize("seed", range(8))
def test_poses_and_moments_of_welded_bodies_agree_with_mujoco(load, seed):
    rng = np.random.default_rng(seed)
    text = random_mjcf(rng)
    ours = load(text)
    q = rng.uniform(-2, 2, ours.n)
    model, data = mujoco_at(text, ours.joint_names, q)
    assert ours.n == model.nq
    for body in range(1, model.nbody):
        expected = homogeneous(data.xmat[body].reshape(3, 3), data.xpos[body])
        assert_allclose(frame_pose(ours, model.body(body).name, q), expected, atol=1e-10)  # chains of metres
    for site in range(model.nsite):
        expected = homogeneous(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
        assert_allclose(frame_pose(ours, model.site(site).name, q), expected, atol=1e-10)
    for number, (link, pose) in enumerate(zip(ours.link_names, link_poses(ours, q), strict=True)):
        R, p = pose[:3, :3], pose[:3, 3]
        tree = ours.tree
        found = moments_about_origin(tree.mass[number], R @ tree.com[number] + p, R @ tree.inertia[number] @ R.T)
        moments = [0.0, np.zeros(3), np.zeros((3, 3))]
        carrier = -1 if "/" in link else model.body(link).id
        for body in np.flatnonzero(model.body_weldid == carrier):
            axes = data.ximat[body].reshape(3, 3)
            turned = axes @ np.diag(model.body_inertia[body]) @ axes.T
            parts = moments_about_origin(model.body_mass[body], data.xipos[body], turned)
            moments = [a + b for a, b in zip(moments, parts, strict=True)]
        for ours_moment, theirs in zip(found, moments, strict=True):
            assert_allclose(ours_moment, theirs, atol=1e-8)  # MuJoCo finds principal axes iteratively


def test_a_body_with_several_joints_is_as_many_links_of_which_only_the_last_has_mass(load):
    model = load(worldbody(f'<body name="b"><joint name="x" type="slide"/><joint name="y"/>{BALL_GEOM}</body>'))
    assert model.link_names == ("b/x", "b")
    assert model.massless == ("b/x",)
    assert model.missing_inertia == ()
    assert_array_equal(model.tree.mass, [0, 1])
    assert model.joint_units == ("m", "rad")


def test_bodies_welded_to_the_world_are_frames_of_the_base(load):
    text = worldbody(
        f'<body name="table" pos="0 0 2">{BALL_GEOM}<body name="arm" pos="1 0 0"><joint/>{BALL_GEOM}</body></body>'
    )
    model = load(text)
    assert model.link_names == ("arm",)
    assert model.frame("table").link == model.frame("world").link == -1
    assert_array_equal(frame_pose(model, "arm", [0.0])[:3, 3], [1, 0, 2])


def test_joints_without_a_name_are_called_by_their_body(load):
    model = load(
        worldbody(f'<body name="b"><joint/>{BALL_GEOM}<body><joint/><joint type="slide"/>{BALL_GEOM}</body></body>')
    )
    assert model.joint_names == ("b", "body2_1", "body2_2")


def test_names_that_are_taken_are_marked_and_noted(load):
    model = load(
        worldbody(
            f'<body name="base"><joint/>{BALL_GEOM}<site name="base" pos="1 0 0"/><site name="s"/><site pos="0 0 1"/></body>'
        )
    )
    assert set(model.frames) == {"base", "base (site)", "world", "s"}
    assert 'site "base" of the file is named "base (site)" here' in model.notes


def test_limits_are_read_where_the_joint_is_limited(load):
    model = load(arm('range="-1 2"', 'actuatorfrcrange="-3 5"'))
    assert_array_equal(model.lower, [-1, -np.inf, -np.inf])
    assert_array_equal(model.upper, [2, np.inf, np.inf])
    assert_array_equal(model.effort_limit, [np.inf, 3, np.inf])


EQUALITY = "<equality>{}</equality>"


def test_joint_equalities_become_coupled_joints_that_obey_mujocos_polynomial(load):
    rest = EQUALITY.format(
        '<joint joint1="elbow" joint2="wrist" polycoef="0.1 2 0 0 0"/>'
        '<joint joint1="shoulder" joint2="elbow" polycoef="0.2 -3 0 0 0"/>'
    )
    text = arm('ref="0.3"', 'ref="-0.4"', rest)
    model = load(text)
    assert model.joint_names == ("wrist",)
    wrist = 0.7
    elbow = -0.4 + 0.1 + 2 * wrist
    shoulder = 0.3 + 0.2 - 3 * (elbow + 0.4)
    theirs, data = mujoco_at(text, ["shoulder", "elbow", "wrist"], [shoulder, elbow, wrist])
    mujoco.mj_forward(theirs, data)
    assert_allclose(data.efc_pos[:2], 0, atol=1e-12)  # MuJoCo agrees that both equalities hold here
    assert_allclose(frame_pose(model, "hand", [wrist])[:3, 3], data.body("hand").xpos, atol=1e-12)


def test_an_equality_without_a_second_joint_holds_the_joint_still(load):
    text = arm("", 'ref="0.5"', EQUALITY.format('<joint joint1="elbow" polycoef="0.2 0 0 0 0"/>'))
    model = load(text)
    assert model.joint_names == ("shoulder", "wrist")
    _, data = mujoco_at(text, ["shoulder", "elbow", "wrist"], [0.3, 0.7, 0.1])
    assert_allclose(frame_pose(model, "hand", [0.3, 0.1])[:3, 3], data.body("hand").xpos, atol=1e-12)


def test_an_inactive_equality_is_left_out_and_noted(load):
    rest = EQUALITY.format(
        '<joint name="off" active="false" joint1="elbow" joint2="wrist"/>'
        '<connect active="false" body1="hand" body2="upper" anchor="0 0 0"/>'
    )
    model = load(arm(rest=rest))
    assert model.n == 3
    assert "left out: equalities that are not active at the start (off, equality1)" in model.notes


@pytest.mark.filterwarnings("ignore:flex 'cloth' is not rigid")
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (arm(rest=EQUALITY.format('<weld body1="hand" body2="upper"/>')), 'equality "equality0" (weld): a loop'),
        (arm(rest='<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>' + EQUALITY.format('<tendon tendon1="t"/>')),
         "(tendon): a loop"),
        (arm(rest=EQUALITY.format('<joint name="bent" joint1="elbow" joint2="wrist" polycoef="0 1 2 0 0"/>')),
         'equality "bent": polycoef [0.0, 1.0, 2.0, 0.0, 0.0]: expected a linear one'),
        (arm(rest=EQUALITY.format('<joint joint1="elbow" joint2="wrist"/><joint joint1="elbow" joint2="shoulder"/>')),
         'equality "equality1": a second one binds joint "elbow"'),
        (arm(rest=EQUALITY.format('<joint joint1="elbow" joint2="wrist"/><joint joint1="wrist" joint2="elbow"/>')),
         'joint "elbow" follows itself: elbow -> wrist -> elbow'),
        (worldbody(f'<body name="b"><freejoint name="f"/>{BALL_GEOM}</body>'), "no moving joint, expected at least one"),
        (worldbody(f'<body name="b"><joint type="ball" name="f"/>{BALL_GEOM}</body>'), 'joint "f" of body "b" is a ball joint'),
        (worldbody(f'<body name="b">{BALL_GEOM}</body>'), "no moving joint, expected at least one"),
        ("<mujoco>", "cannot be read as XML: no element found: line 1"),
        ("<mujoco><foo/></mujoco>", "MuJoCo cannot read it: XML Error: Schema violation: unrecognized element"),
        (worldbody('<body><joint axis="0 0 0"/><geom size="1"/></body>'), "MuJoCo cannot read it: Error: axis too small"),
        (worldbody('<body><joint/><geom type="mesh" mesh="none"/></body>'), "MuJoCo cannot read it"),
        (worldbody('<flexcomp name="cloth" type="grid" count="3 3 1" spacing="1 1 1" dim="2" mass="1"/>'), 'flexible body "cloth"'),
    ],
)  # fmt: skip
def test_what_no_tree_has_and_what_mujoco_cannot_read_is_refused_by_name(load, text, said):
    with pytest.raises(
        FileFormatError if "cannot be read" in said or "MuJoCo" in said else UnsupportedModelError
    ) as caught:
        load(text)
    assert said in str(caught.value)
    assert "robot.xml: " in str(caught.value)


SKELETON = worldbody(
    '<body name="a" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
    '<inertial pos="0.1 0 0" mass="1e-6" diaginertia="1e-9 2e-9 2e-9"/>'
    '<body name="b" pos="1 0 0"><joint name="k" axis="0 0 1"/></body></body>'
)


def test_a_body_without_mass_is_named_and_the_masses_of_the_others_are_as_they_were(load):
    model = load(SKELETON)
    assert model.name == "robot"  # its file's, as it has none of its own
    assert model.missing_inertia == ("b",)
    assert_array_equal(frame_pose(model, "b", [0.0, 0.0])[:3, 3], [1, 0, 1])
    with pytest.raises(MissingInertiaError, match='"b"'):
        model.require_inertia()
    assert load(SKELETON, massless=["b"]).massless == ("b",)
    alone = load(SKELETON.replace('<body name="b" pos="1 0 0"><joint name="k" axis="0 0 1"/></body>', ""))
    assert alone.missing_inertia == ()
    assert_array_equal(model.tree.mass, [1e-6, 0])
    assert_array_equal(model.tree.com[0], alone.tree.com[0])
    assert_array_equal(model.tree.inertia[0], alone.tree.inertia[0])
    assert_array_equal(model.tree.inertia[1], np.zeros((3, 3)))


def test_a_body_whose_mass_is_in_what_is_welded_to_it_misses_nothing(load):
    model = load(worldbody(f'<body name="a"><joint/><body name="b" pos="1 0 0">{BALL_GEOM}</body></body>'))
    assert model.missing_inertia == ()
    assert_allclose(model.tree.com, [[1, 0, 0]])


def test_what_is_left_out_is_said_by_name(load):
    text = arm(
        'armature="1" damping="1"',
        'frictionloss="1" stiffness="1"',
        '<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>'
        '<actuator><motor name="m" joint="elbow"/></actuator><option gravity="0 0 -1.6"/>',
    ).replace('<body name="hand"', '<body name="hand" gravcomp="1"')
    assert load(text).notes == (
        "left out: gravity compensation of bodies (hand)",
        "left out: tendons (t)",
        "left out: actuators with their gears and limits (m)",
        "inertia from the shapes of geoms, not from <inertial> (upper, lower, hand)",
        "left out: the file's gravity [0.0, 0.0, -1.6]; gravity is an argument here",
    )


FOLLOWS = '<equality><joint joint1="wrist" joint2="elbow" polycoef="0.2 -1.5 0 0 0"/></equality>'


@pytest.mark.parametrize("follower", ["", FOLLOWS])
def test_friction_rotors_and_springs_of_joints_ask_what_they_ask_in_mujoco(load, rng, follower):
    first = 'armature="0.3" damping="2" stiffness="5" springref="0.4"'
    text = arm(first, 'frictionloss="0.7" damping="0.1"', follower)
    text = text.replace('axis="1 0 0"', 'axis="1 0 0" damping="0.5" armature="0.05" stiffness="3" frictionloss="0.2"')
    ours, model = load(text), mujoco.MjModel.from_xml_string(text)
    loads = known_loads(ours)
    rows = [rng.normal(size=(1, ours.n)) for _ in range(3)]
    shares = np.eye(3)[:, : ours.n]  # of the coordinates in MuJoCo's joints
    if follower:
        shares[2] = [0.0, -1.5]
    q, qd, qdd = (shares @ row[0] for row in rows)
    if follower:
        q[2] += 0.2
    passive = model.dof_damping * qd + model.jnt_stiffness * (q - model.qpos_spring)
    expected = passive + model.dof_frictionloss * np.sign(qd) + model.dof_armature * qdd
    asked = loads.torque(*rows)[0]
    assert_allclose(asked, shares.T @ expected, atol=1e-12)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_forward(model, data)
    assert_allclose(data.qfrc_passive, -passive, atol=1e-12)
    assert f"{'shoulder' if follower else 'wrist'}" in [term.name for term in ours.actuation.motor_inertia]


@pytest.mark.parametrize("file", ["main.xml", "main.mjcf"])
def test_included_files_and_meshes_are_found_beside_the_file(tmp_path, file):
    mesh = tmp_path / "meshes" / "part.obj"
    mesh.parent.mkdir()
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [(1, 3, 4), (1, 4, 2), (5, 6, 8), (5, 8, 7), (1, 2, 6), (1, 6, 5), (3, 7, 8), (3, 8, 4), (1, 5, 7), (1, 7, 3), (2, 4, 8), (2, 8, 6)]  # fmt: skip
    mesh.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {a} {b} {c}\n" for a, b, c in faces)
    )
    part = tmp_path / "part.xml"
    part.write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="p" file="part.obj"/></asset><worldbody>'
        '<body name="b"><joint/><geom type="mesh" mesh="p" density="10"/></body></worldbody></mujoco>'
    )
    main = tmp_path / file
    main.write_text('<mujoco model="m"><include file="part.xml"/></mujoco>')
    model = load_mjcf(main)
    assert_allclose(model.tree.mass, [10])  # a cube of one metre
    assert_allclose(model.tree.com, [[0.5, 0.5, 0.5]], atol=1e-6)  # mesh vertices are single precision
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (main, part)]
    assert model.sources == (f"{file}, sha256 {digests[0]}", f"part.xml, sha256 {digests[1]}")
    assert model.name == "m"


def test_without_mujoco_the_error_says_what_to_install(load, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'mujoco>="):
        load(arm())


@pytest.mark.parametrize(
    "text",
    [
        own_base.MJCF,
        own_base.MJCF.replace('"tip"', '"base"').replace('name="base" pos="0.1 0 0" q', 'name="b" pos="0.1 0 0" q'),
    ],
)
def test_a_body_or_site_named_base_keeps_its_name_and_place_and_the_base_is_the_world(load, text):
    ours = load(text)
    _, data = mujoco_at(text, ours.joint_names, [0.4])
    theirs = data.body("base") if "b" not in ours.frames else data.site("base")
    assert ours.base == "world"
    assert_allclose(frame_pose(ours, "base", [0.4])[:3, 3], theirs.xpos, atol=1e-12)
    assert_allclose(frame_pose(ours, "base", [0.4])[:3, :3].ravel(), theirs.xmat, atol=1e-12)
    assert_allclose(frame_pose(ours, "shoulder", [0.4])[:3, 3], data.body("shoulder").xpos, atol=1e-12)


def test_namespaces_are_passed_over_as_mujoco_does_and_bodies_are_counted_all_the_same(load):
    ours = load(arm().replace("<mujoco", '<mujoco xmlns="http://mujoco.org" m:x="1"'))
    assert_allclose(frame_pose(ours, "hand", [0.1, 0.2, 0.3]), frame_pose(load(arm()), "hand", [0.1, 0.2, 0.3]))
    many = worldbody(f'<replicate count="2000">{BALL_GEOM}<body><joint/>{BALL_GEOM}</body></replicate>')
    with pytest.raises(FileFormatError, match="bodies, expected at most 1000"):
        load(many.replace("<mujoco", '<mujoco xmlns="http://mujoco.org"'))


FREE = "<freejoint/>"
CUP = f'<body name="cup" pos="3 0 0">{FREE}{BALL_GEOM}<body name="lid"><geom size="0.1"/></body></body>'
SCENE = '<keyframe><key qpos="0 0 0 1 0 0 0 0 0 0"/></keyframe><equality><weld body1="cup" body2="upper"/></equality>'


def test_free_bodies_of_a_scene_are_left_aside_and_free_bases_stand(load):
    alone = load(arm())
    scene = load(arm(rest=SCENE).replace("<worldbody>", f"<worldbody>{CUP}"))
    assert (scene.joint_names, scene.link_names) == (alone.joint_names, alone.link_names)
    assert_array_equal(scene.tree.com, alone.tree.com)
    assert "left out: free bodies that carry no joint (cup)" in scene.notes
    pelvis = f'<worldbody><body name="pelvis" pos="0 0 2">{FREE}{BALL_GEOM}'
    standing = load(arm().replace("<worldbody>", pelvis).replace("</worldbody>", "</body></worldbody>"))
    assert standing.joint_names == alone.joint_names
    assert_array_equal(frame_pose(standing, "upper", [0, 0, 0])[:3, 3], [0, 0, 3])
    assert "free bodies are fixed where the file puts them (pelvis)" in standing.notes


def test_a_mesh_that_is_not_there_is_left_out_unless_a_mass_is_taken_from_it(load):
    asset = '<asset><mesh name="look" file="look.stl"/></asset>'
    picture = '<geom type="mesh" mesh="look" contype="0" conaffinity="0"/>'
    told = '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>'
    text = worldbody(f'<body name="a"><joint/>{told}{picture}</body>', rest=asset)
    model = load(text)
    assert_array_equal(model.tree.mass, [2.0])
    assert "left out: meshes whose files are not there (look.stl)" in model.notes
    weightless = picture.replace("/>", ' mass="0"/>')
    light = worldbody(f'<body name="a"><joint/>{BALL_GEOM}{weightless}</body>', rest=asset)
    assert_array_equal(load(light).tree.mass, [1.0])
    with pytest.raises(FileFormatError, match=r"no mesh 'look\.stl', from which the mass of body"):
        load(text.replace(told, ""))
