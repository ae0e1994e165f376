import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import root

from catenary.arrays import Floats
from catenary.control.elastic_pd import ElasticPD, stiffness_margin
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference

ARM = load_robot("two_link")
DOWN = np.array([0.0, 0.0, -9.81])
KP, KD, SPRINGS = np.array([300.0, 120.0]), np.array([20.0, 8.0]), np.array([200.0, 90.0])
GOAL = Reference(np.array([0.4, -0.7]), np.zeros(2), np.zeros(2))


def state(theta: Floats) -> JointState:
    return JointState(0.0, theta, np.zeros(len(theta)), np.zeros(len(theta)), np.zeros(0), DOWN, 0.0)


def rest(controller: ElasticPD) -> Floats:
    """Where the links come to rest: the springs hold gravity, and the motors hold the springs."""

    def unbalanced(x: Floats) -> Floats:
        q, theta = x[:2], x[2:]
        spring = controller.stiffness * (theta - q)
        held = spring - gravity_torque(ARM, q, DOWN)
        return np.concatenate([held, controller.torque(state(theta), GOAL) - spring])

    solution: Floats = root(unbalanced, np.concatenate([GOAL.q, GOAL.q]), tol=1e-10).x
    assert_allclose(unbalanced(solution), 0.0, atol=1e-7)  # of torques of some 10 Nm
    return solution[:2]


@pytest.mark.parametrize("compensation", ["constant", "biased"])
def test_links_come_to_rest_at_the_reference(compensation: str) -> None:
    controller = ElasticPD(ARM, KP, KD, SPRINGS, compensation=compensation)  # type: ignore[arg-type]
    assert_allclose(rest(controller), GOAL.q, atol=1e-9)


def test_gravity_at_the_motors_leaves_the_error_that_the_paper_derives() -> None:
    q = rest(ElasticPD(ARM, KP, KD, SPRINGS, compensation="online"))
    assert np.abs(q - GOAL.q).max() > 1e-3
    g = gravity_torque(ARM, q, DOWN)
    theta = q + g / SPRINGS
    theta_ref = GOAL.q + gravity_torque(ARM, GOAL.q, DOWN) / SPRINGS
    assert_allclose(KP * (theta_ref - theta), g - gravity_torque(ARM, theta, DOWN), atol=1e-9)


def test_motors_are_taken_for_links_beyond_stiff_springs_and_for_the_goals_when_biased() -> None:
    theta, stiff = np.array([0.3, -0.5]), np.full(2, 1e12)
    controller = ElasticPD(ARM, KP, KD, stiff, compensation="online")
    expected = KP * (GOAL.q - theta) + gravity_torque(ARM, theta, DOWN)
    assert_allclose(controller.torque(state(theta), GOAL), expected, rtol=1e-9)
    biased, g = ElasticPD(ARM, KP, KD, SPRINGS), gravity_torque(ARM, GOAL.q, DOWN)
    biased.torque(state(GOAL.q + g / SPRINGS), GOAL)
    assert_allclose(biased.feedforward, g, rtol=1e-12)


def test_slope_of_a_pendulum_is_its_weight_times_its_arm() -> None:
    # both links hanging or standing straight: dg1/dq1 = 9.81 (m1 l1/2 + m2 (l1 + l2/2)), the largest there is
    soft_second = np.array([200.0, 1e9])
    margin = stiffness_margin(ARM, np.array([1e12, 1e12]), soft_second, gravity=DOWN)
    assert_allclose(margin.slope, 9.81 * (0.5 + 1.25) / 200.0, rtol=1e-3)
    assert abs(np.sin(margin.q[0])) > 0.99


def test_any_direction_of_gravity_is_looked_at_when_none_is_given() -> None:
    # gravity across a planar arm asks nothing of it; the search must find the plane
    across = stiffness_margin(ARM, KP, SPRINGS, gravity=[0.0, 9.81, 0.0])
    assert across.slope == pytest.approx(0.0, abs=1e-9)
    within = stiffness_margin(ARM, KP, SPRINGS, gravity=DOWN)
    assert_allclose(stiffness_margin(ARM, KP, SPRINGS).slope, within.slope, rtol=1e-2)  # of a search
    # the paper's matrix, where all joints are in rad: it implies ours, which depends on no unit
    K, gains = np.diag(SPRINGS), np.diag(KP)
    least = np.linalg.eigvalsh(np.block([[K, -K], [-K, K + gains]])).min()
    assert least > 9.81 * (0.5 + 1.25 + 0.5)  # bound of the norm of dg/dq
    assert within.slope < 1.0


def test_the_ravens_own_springs_and_gains_hold() -> None:
    margin = stiffness_margin(load_robot("raven2"), [454.0, 362.0, 57e3], [264.0, 507.0, 71e3])
    assert margin.slope < 0.05


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stiffness": [1.0]}, "stiffness: expected shape"),
        ({"stiffness": [0.0, 1.0]}, "stiffness: expected more than 0"),
        ({"kp": [0.0, 1.0]}, "kp: expected more than 0"),
        ({"compensation": "none"}, "expected one of constant, online, biased"),
        # 10 and 300, 5 and 120 in series
        ({"stiffness": [10.0, 5.0]}, r"gravity changes by .* times the joints' stiffness.*\[9.677, 4.8\]"),
        ({"kp": [10.0, 5.0]}, "times the joints' stiffness"),
    ],
)
def test_impossible_settings_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        ElasticPD(ARM, **{"kp": KP, "kd": KD, "stiffness": SPRINGS, **options})  # type: ignore[arg-type]
