import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.robots.assembly import Coordinate
from catenary.robots.dh import DHRobot, DHRow, from_dh
from catenary.spatial import Pose, rotation_from_rpy
from oracles.tree_poses import frame_pose, homogeneous


def modified_product(alpha, a, d, theta):
    """Craig, Introduction to Robotics, eq. 3.6, written out."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st, 0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0, 0, 0, 1],
        ]
    )


def standard_product(alpha, a, d, theta):
    """Denavit and Hartenberg's matrix, as in Spong, Robot Modeling and Control, eq. 3.10."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def row(name="a", joint="revolute", **numbers):
    return DHRow(name, joint, **{"alpha": 0.0, "a": 0.0, "d": 0.0, "theta": 0.0, **numbers})


def robot(*rows, convention="modified", **options):
    return DHRobot("r", convention, rows, **options)


@pytest.mark.parametrize(
    ("convention", "product"), [("modified", modified_product), ("standard", standard_product)]
)
@pytest.mark.parametrize("seed", range(4))
def test_poses_are_the_product_of_the_conventions_matrices(convention, product, seed):
    rng = np.random.default_rng(seed)
    kinds = ["revolute", "prismatic", "fixed", "revolute", "prismatic", "revolute"]
    table = rng.normal(size=(6, 4))
    base = Pose(rotation_from_rpy(rng.normal(size=3)), rng.normal(size=3))
    rows = [
        DHRow(f"r{i}", kind, *numbers) for i, (kind, numbers) in enumerate(zip(kinds, table, strict=True))
    ]
    model = from_dh(robot(*rows, convention=convention, base=base))
    q = rng.normal(size=model.n)
    expected = homogeneous(base.rotation, base.position)
    left = list(q)
    for number, (kind, (alpha, a, d, theta)) in enumerate(zip(kinds, table, strict=True)):
        theta_now = theta + (left.pop(0) if kind == "revolute" else 0.0)
        d_now = d + (left.pop(0) if kind == "prismatic" else 0.0)
        expected = expected @ product(alpha, a, d_now, theta_now)
        assert_allclose(frame_pose(model, f"r{number}", q), expected, atol=1e-12)


def test_a_table_may_branch():
    model = from_dh(
        robot(row("a", a=1.0), row("b", a=1.0), row("c", a=2.0, parent="a"), row("d", parent="base"))
    )
    assert_array_equal(model.tree.parent, [-1, 0, 0, -1])
    assert_array_equal(frame_pose(model, "c", np.zeros(4))[:3, 3], [3, 0, 0])


def test_every_branch_that_hangs_on_the_base_has_the_tables_base_pose():
    up = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    model = from_dh(robot(row("a"), row("b", parent="base"), base=up, base_frame="foot"))
    for frame in ("a", "b", "foot"):
        assert_array_equal(frame_pose(model, frame, np.zeros(2))[:3, 3], [0, 0, 1])


# a parallelogram, whose second link keeps its direction when the first turns; a row without a coordinate of its own
@pytest.mark.parametrize(("variable", "names", "coupling"), [
    ({"b": 1.0, "a": -1.0}, ("a", "b"), [[1, 0], [-1, 1]]),
    ({"a": 2.0}, ("a",), [[1], [2]]),
])  # fmt: skip
def test_a_row_may_move_with_other_rows_coordinates(variable, names, coupling):
    model = from_dh(robot(row("a", a=1.0), row("b", a=1.0, variable=variable)))
    assert model.joint_names == names
    assert_array_equal(model.coupling, coupling)


def test_limits_and_units_are_those_of_the_rows_own_coordinates():
    model = from_dh(robot(row("a", lower=-1.0, upper=2.0), row("b", "prismatic")))
    assert_array_equal(model.lower, [-1, -np.inf])
    assert_array_equal(model.upper, [2, np.inf])
    assert model.joint_units == ("rad", "m")


def test_the_tip_is_the_last_row_unless_named():
    assert from_dh(robot(row("a"), row("b"))).tip == "b"
    assert from_dh(robot(row("a"), row("b"), tip="a")).tip == "a"


@pytest.mark.parametrize(("description", "said"), [
    (robot(), 'robot "r": the DH table has no rows'),
    (robot(row(), convention="craig"), 'convention "craig": expected "modified" or "standard"'),
    (robot(row(alpha=np.nan)), 'robot "r": DH row "a": alpha is nan, expected a finite number'),
    (robot(row(d=np.inf)), 'DH row "a": d is inf'),
    (robot(row(), row("b", variable={"a": 1.0}, lower=0.0)), 'DH row "b": has limits but no coordinate of its own'),
    (robot(row(upper=1.0), coordinates=[Coordinate("a", "rad")]), 'DH row "a": has limits but no coordinate'),
    (robot(row(variable={"x": 1.0})), 'link "a": moves with unknown coordinate "x"; coordinates: none'),
])  # fmt: skip
def test_a_bad_table_is_refused_by_robot_and_row(description, said):
    with pytest.raises(InputError) as caught:
        from_dh(description)
    assert said in str(caught.value)


def test_a_row_is_massless_by_itself_or_by_the_robots_list():
    model = from_dh(robot(row("a", massless=True), row("b"), row("c"), massless=["c"]))
    assert model.massless == ("a", "c")
    assert model.missing_inertia == ("b",)
