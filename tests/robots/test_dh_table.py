import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import own_base
from catenary.errors import ConfigError, InputError, UnsupportedModelError
from catenary.robots.dh_table import load_table
from catenary.spatial import Pose, rotation_from_rpy
from oracles.dh_products import PRODUCTS
from oracles.tree_poses import frame_pose, homogeneous

HEAD = 'name = "r"\nconvention = "modified"\nsources = ["assumed"]\n'
MASS = "mass_kg = 2\ncom_m = [0.1, 0.2, 0.3]\ninertia_kg_m2 = [1, 0.1, 0.2, 2, 0.3, 2.5]\n"


def row(name, joint="revolute", numbers="alpha_deg = 0\na_m = 0\nd_m = 0\ntheta_deg = 0\n", more=MASS):
    return f'[[link]]\nname = "{name}"\njoint = "{joint}"\n{numbers}{more}'


ONE = HEAD + row("a")


@pytest.fixture
def load(tmp_path):
    """Load a text as a file called robot.toml."""

    def load_text(text, **options):
        path = tmp_path / "robot.toml"
        path.write_text(text)
        return load_table(path, **options)

    return load_text


def product_row(name, joint, alpha, a, d, theta):
    angles = f"alpha_deg = {np.rad2deg(alpha)!r}\ntheta_deg = {np.rad2deg(theta)!r}\n".replace("np.float64(", "")
    return row(name, joint, f"{angles}a_m = {a}\nd_m = {d}\n".replace(")", ""), "")


@pytest.mark.parametrize("convention", PRODUCTS)
@pytest.mark.parametrize("seed", range(4))
def test_poses_are_the_product_of_the_conventions_matrices(load, convention, seed):
    rng = np.random.default_rng(seed)
    kinds = ["revolute", "prismatic", "fixed", "revolute", "prismatic", "revolute"]
    table = rng.normal(size=(6, 4))
    base = Pose(rotation_from_rpy(rng.normal(size=3)), rng.normal(size=3))
    text = f"base_rotation = {base.rotation.tolist()}\nbase_position_m = {base.position.tolist()}\n"
    text += HEAD.replace("modified", convention)
    text += "".join(
        product_row(f"r{i}", kind, *numbers) for i, (kind, numbers) in enumerate(zip(kinds, table, strict=True))
    )
    model = load(text)
    q = rng.normal(size=model.n)
    expected = homogeneous(base.rotation, base.position)
    left = list(q)
    for number, (kind, (alpha, a, d, theta)) in enumerate(zip(kinds, table, strict=True)):
        theta_now = theta + (left.pop(0) if kind == "revolute" else 0.0)
        d_now = d + (left.pop(0) if kind == "prismatic" else 0.0)
        expected = expected @ PRODUCTS[convention](alpha, a, d_now, theta_now)
        assert_allclose(frame_pose(model, f"r{number}", q), expected, atol=1e-12)


def along_x(name, a, more=""):
    return row(name, numbers=f"alpha_deg = 0\na_m = {a}\nd_m = 0\ntheta_deg = 0\n", more=more)


def test_a_table_may_branch(load):
    rows = (along_x("a", 1), along_x("b", 1), along_x("c", 2, 'parent = "a"\n'), along_x("d", 0, 'parent = "base"\n'))
    model = load(HEAD + "".join(rows))
    assert_array_equal(model.tree.parent, [-1, 0, 0, -1])
    assert_array_equal(frame_pose(model, "c", np.zeros(4))[:3, 3], [3, 0, 0])
    assert model.tip == "d"


def test_every_branch_that_hangs_on_the_base_has_the_tables_base_pose(load):
    head = 'base_position_m = [0, 0, 1]\nbase_frame = "foot"\n' + HEAD
    model = load(head + along_x("a", 0) + along_x("b", 0, 'parent = "base"\n'))
    for frame in ("a", "b", "foot"):
        assert_array_equal(frame_pose(model, frame, np.zeros(2))[:3, 3], [0, 0, 1])


# a parallelogram, whose second link keeps its direction when the first turns; a row without a coordinate of its own
@pytest.mark.parametrize(("variable", "names", "coupling"), [
    ("{ b = 1, a = -1 }", ("a", "b"), [[1, 0], [-1, 1]]),
    ("{ a = 2 }", ("a",), [[1], [2]]),
])  # fmt: skip
def test_a_row_may_move_with_other_rows_coordinates(load, variable, names, coupling):
    model = load(HEAD + along_x("a", 1) + along_x("b", 1, f"variable = {variable}\n"))
    assert model.joint_names == names
    assert_array_equal(model.coupling, coupling)


def test_degrees_become_radians_and_six_numbers_a_tensor(load):
    numbers = "alpha_deg = 90\na_m = 1\nd_m = 2\ntheta_deg = 180\n"
    model = load(HEAD + row("a", numbers=numbers, more=MASS + "limits_deg = [-90, 180]\n"))
    assert_allclose(model.tree.rotation[0], [[-1, 0, 0], [0, 0, -1], [0, -1, 0]], atol=1e-15)
    assert_allclose(model.tree.origin[0], [1, -2, 0], atol=1e-15)
    assert_allclose([model.lower[0], model.upper[0]], [-np.pi / 2, np.pi])
    assert_array_equal(model.tree.com, [[0.1, 0.2, 0.3]])
    assert_array_equal(model.tree.inertia, [[[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2.5]]])


def test_coordinates_may_stand_apart_from_the_rows(load):
    text = (
        HEAD
        + row("a", more='variable = { motor = 2 }\nmassless = true\nsource = "guess"\n')
        + row("b", more="variable = { motor = -1, slide = 3 }\nmassless = true\n")
        + '[[coordinate]]\nname = "slide"\nunit = "m"\nlimits_m = [0, 1]\n'
        + '[[coordinate]]\nname = "motor"\nunit = "rad"\nlimits_deg = [0, 90]\n'
    )
    model = load(text)
    assert model.joint_names == ("slide", "motor")
    assert_array_equal(model.coupling, [[0, 2], [3, -1]])
    assert_allclose(model.upper, [1, np.pi / 2])
    assert model.sources == ("assumed", "a: guess")


def test_frames_and_the_base_pose_are_read(load):
    text = HEAD + 'base_position_m = [0, 0, 1]\nbase_frame = "foot"\ntip = "end"\n' + row("a")
    model = load(text + '[[frame]]\nname = "end"\nlink = "a"\nposition_m = [0, 0, 2]\n')
    assert_array_equal(frame_pose(model, None, [0.0])[:3, 3], [0, 0, 3])
    assert_array_equal(frame_pose(model, "foot", [0.0])[:3, 3], [0, 0, 1])


def test_a_row_may_declare_on_which_axes_its_centre_of_mass_lies(load):
    on_x = MASS.replace("[0.1, 0.2, 0.3]", "[0.1, 0, 0]") + 'axes_of_com = ["x"]\n'
    text = HEAD + row("a", more=on_x) + row("b", more="") + row("c", more="massless = true\naxes_of_com = []\n")
    model = load(text + row("d", more=""), massless=["d"])
    assert_array_equal(model.axes_of_com, [[True, False, False], [True] * 3, [False] * 3, [True] * 3])
    assert (model.missing_inertia, model.massless) == (("b",), ("c", "d"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD, "link: this key is missing"),
        (HEAD + "link = []", "link: List should have at least 1 item"),
        (ONE.replace("a_m = 0\n", ""), 'link[0] "a": a_m: this key is missing'),
        (HEAD + row("a") + row("b").replace("theta_deg = 0\n", ""), 'link[1] "b": theta_deg: this key is missing'),
        (ONE.replace("alpha_deg", "alpha"), 'link[0] "a": alpha: unknown key; a number\'s key ends in its unit: alpha_deg'),
        (ONE.replace("alpha_deg", "alpha"), 'link[0] "a": alpha_deg: this key is missing'),
        (ONE.replace("a_m = 0", "a = 0"), "a: unknown key; a number's key ends in its unit: a_m"),
        (ONE.replace("mass_kg", "mass"), "mass: unknown key; a number's key ends in its unit: mass_kg"),
        (ONE.replace("alpha_deg", "alpha_rad"), 'alpha_rad: unknown key; did you mean "alpha_deg"?'),
        (ONE.replace("com_m", "com"), "com: unknown key; a number's key ends in its unit: com_m"),
        (ONE + "limits = [0, 1]", "limits_deg or limits_m"),
        (ONE.replace("a_m = 0", 'a_m = "0"'), 'link[0] "a": a_m: Input should be a valid number, got \'0\''),
        (ONE.replace("a_m = 0", "a_m = nan"), "a_m: Input should be a finite number"),
        (ONE.replace('"revolute"', '"ball"'), "joint: Input should be 'revolute', 'prismatic' or 'fixed', got 'ball'"),
        (ONE.replace('"modified"', '"craig"'), "convention: Input should be 'modified' or 'standard'"),
        (ONE.replace("[0.1, 0.2, 0.3]", "[0.1, 0.2]"), 'link[0] "a": com_m'),
        (ONE + 'variable = { a = "1" }', 'link[0] "a": variable: a: Input should be a valid number'),
        (ONE + 'variable = ["a"]', 'link[0] "a": variable: Input should be an object'),
        (ONE + "limits_m = [0, 1]", '"a" is in rad: expected limits_deg for its limits'),
        (ONE.replace("mass_kg = 2\n", ""), 'link "a": com_m or inertia_kg_m2 without mass_kg'),
        (ONE.replace("com_m = [0.1, 0.2, 0.3]\n", ""), 'link "a": has mass_kg but no com_m'),
        (ONE + "massless = true", 'link "a": is massless and has mass_kg'),
        (ONE + 'axes_of_com = ["w"]', 'link[0] "a": axes_of_com'),
        (ONE + '[[frame]]\nname = "f"\nlink = "a"\nposition_m = [0, 0, 0]\n' * 2, 'two frames are named "f"'),
        ("base_frame = 'f'\n" + ONE + '[[frame]]\nname = "f"\nlink = "a"\nposition_m = [0, 0, 0]\n', 'two frames are named "f"'),
    ],
)  # fmt: skip
def test_a_wrong_key_is_refused_by_file_row_and_key(load, text, said):
    with pytest.raises(ConfigError) as caught:
        load(text)
    assert said in str(caught.value)
    assert "robot.toml: " in str(caught.value)


@pytest.mark.parametrize(("text", "error", "said"), [
    (ONE + "variable = { x = 1 }", InputError, 'link "a": moves with unknown coordinate "x"'),
    (ONE + 'variable = { a = 1 }\n' + row("b", more='variable = { a = 1 }\nlimits_deg = [0, 1]\n'), InputError,
     'DH row "b": has limits but no coordinate of its own'),
    (ONE + 'limits_deg = [0, 1]\n[[coordinate]]\nname = "a"\nunit = "rad"\n', InputError, "has limits but no coordinate"),
    (ONE + 'effort_nm = 5.0\n[[coordinate]]\nname = "a"\nunit = "rad"\n', InputError, "has limits but no coordinate"),
    (ONE + 'velocity_deg_s = 9.0\n[[coordinate]]\nname = "a"\nunit = "rad"\n', InputError, "has limits but no coordinate"),
    ("base_rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\n" + ONE, InputError, "expected a rotation matrix"),
    (HEAD + row("a", "fixed"), UnsupportedModelError, "no moving joint"),
])  # fmt: skip
def test_numbers_that_make_no_robot_are_refused_by_file_and_row(load, text, error, said):
    with pytest.raises(error, match=rf"robot\.toml: .*{said}"):
        load(text)


def test_limits_of_torque_and_force_are_the_models(load):
    model = load(ONE + "effort_nm = 87\n" + row("b", joint="prismatic", more=MASS + "effort_n = 5\n"))
    assert_array_equal(model.effort_limit, [87.0, 5.0])
    assert load(ONE).effort_limit[0] == np.inf


@pytest.mark.parametrize(
    ("joint", "key", "other"), [("revolute", "effort_n", "effort_nm"), ("prismatic", "effort_nm", "effort_n")]
)
def test_a_limit_in_the_other_kinds_unit_is_refused(load, joint, key, other):
    with pytest.raises(ConfigError, match=f'"a" is in .*: expected {other} for its limits'):
        load(HEAD + row("a", joint=joint, more=MASS + f"{key} = 3\n"))
    with pytest.raises(ConfigError, match=f"{other}"):
        load(HEAD + row("a", joint=joint, more=MASS + f"{other} = -3\n"))


def test_a_tables_own_frame_may_be_named_base_where_its_root_has_another_name(load):
    model = load(own_base.TABLE)
    assert (model.base, set(model.frames)) == ("base_link", {"base", "base_link", "shoulder"})
    assert_array_equal(frame_pose(model, "base", [0.0])[:3, 3], [0.1, 0, 0])
    assert_allclose(frame_pose(model, "shoulder", [0.0])[:3, 3], [-0.1, 0, 0.3], atol=1e-15)
    with pytest.raises(InputError, match='frame "base" has the name of another'):
        load(own_base.TABLE.replace('root = "base_link"', ""))
