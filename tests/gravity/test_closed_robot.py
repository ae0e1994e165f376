"""Motors of closed loops against MuJoCo's equality constraints."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.errors import InputError, UnsupportedModelError
from catenary.gravity.closed_robot import load_closed_robot
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from oracles.mujoco_loops import held

BAR = '<inertial pos="{x} 0.01 0.02" mass="{m}" fullinertia="0.02 0.025 0.03 0.001 0 0.002"/>'


def bar(name, joint, pos, x, m, inner="", kind="hinge", axis="0 1 0"):
    inertial = BAR.format(x=x, m=m)
    return (
        f'<body name="{name}" pos="{pos}"><joint name="{joint}" type="{kind}" axis="{axis}"/>{inertial}{inner}</body>'
    )


def mechanism(bodies, equality, motors=("crank",), rest=""):
    driven = "".join(f'<motor joint="{name}"/>' for name in motors)
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody><equality>{equality}</equality>'
        f"<actuator>{driven}</actuator>{rest}</mujoco>"
    )


# links along x at zero: a crank of 0.2 m upright by its mount, a coupler of 0.5 m, a rocker of 0.3 m that meets it
FOUR_BAR = mechanism(
    '<body name="mount" quat="0.96 0.05 -0.28 0.02">'
    + bar("crank_link", "crank", "0 0 0", 0.1, 1.0, bar("coupler_link", "coupler", "0.2 0 0", 0.25, 0.7,
          bar("hand", "wrist", "0.5 0 0", 0.05, 0.3, axis="1 0 0")))
    + bar("rocker_link", "rocker", "0.5 0 -0.3", 0.15, 0.8) + "</body>",
    '<connect name="pin" body1="coupler_link" body2="rocker_link" anchor="0.5 0 0"/>', ("crank", "wrist"),
)  # fmt: skip
SLIDER_CRANK = mechanism(
    bar("crank_link", "crank", "0 0 0", 0.1, 1.0, bar("rod", "pin", "0 0 0.2", 0.2, 0.5))
    + bar("piston", "slide", "0.4 0 0.2", 0.0, 2.0, kind="slide", axis="1 0 0"),
    '<connect name="head" body1="rod" body2="piston" anchor="0.4 0 0"/>', ("slide",),
)  # fmt: skip
FIVE_BAR = mechanism(
    bar("left", "a", "0 0 0", 0.1, 1.0, bar("upper", "c", "0 0 0.3", 0.1, 0.5, '<site name="end" pos="0.15 0 0.25"/>'))
    + bar("right", "b", "0.3 0 0", 0.1, 1.2, bar("lower", "d", "0 0 0.3", 0.1, 0.6, '<site name="meets" pos="-0.15 0 0.25"/>')),
    '<connect name="tip" site1="end" site2="meets"/>', ("a", "b"),
)  # fmt: skip
LOOPS = {
    "four-bar": (FOUR_BAR, ["crank", "wrist"], 0.25),
    "slider-crank": (SLIDER_CRANK, ["slide"], 0.04),
    "five-bar": (FIVE_BAR, ["a", "b"], 0.4),
}


@pytest.fixture
def written(tmp_path):
    def write(text, name="robot.xml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("kind", LOOPS)
def test_motors_hold_and_feel_what_mujocos_constraint_asks(written, rng, kind):
    text, motors, reach = LOOPS[kind]
    robot = load_closed_robot(written(text))
    assert list(robot.joint_names) == motors
    q = rng.uniform(-reach, reach, (10, robot.n))
    gravity = rng.normal(size=(10, 3)) * 6.0
    torque, x, J = robot.gravity_torque(q, gravity), robot.positions(q), robot.jacobian(q)
    M = np.swapaxes(J, 1, 2) @ mass_matrix(robot.opened, x) @ J
    for k in range(10):
        oracle = held(text, motors, dict(zip(robot.opened.joint_names, x[k], strict=True)), gravity[k])
        assert oracle.gap < 1e-10
        assert_allclose(torque[k], oracle.torque, rtol=0, atol=1e-8)
        assert_allclose(M[k], oracle.mass, rtol=0, atol=1e-8)
    assert_allclose(robot.gravity_torque(q[0], gravity[0]), torque[0], atol=1e-12)


PARALLELOGRAM = mechanism(
    bar("upper", "shoulder", "0 0 0.2", 0.2, 3.0, bar("fore", "elbow", "0.4 0 0", 0.1, 1.5))
    + bar("lever", "crank", "0 0 0.2", 0.05, 0.4, bar("rod", "rod_pin", "0 0 -0.1", 0.2, 0.3)),
    '<connect name="rod" body1="rod" body2="fore" anchor="0.4 0 0"/>', ("shoulder", "crank"),
)  # fmt: skip


def test_a_parallelogram_is_a_tree_in_its_motors_coordinates(written, rng):
    """An arm whose elbow is driven by a lever at the shoulder over a rod: elbow = crank - shoulder."""
    robot = load_robot(written(PARALLELOGRAM))
    assert robot.joint_names == ("shoulder", "crank")
    assert_allclose(robot.coupling[robot.link_names.index("fore")], [-1.0, 1.0], atol=0)
    assert any("joints that follow in a loop: elbow, rod_pin" in note for note in robot.notes)
    for _ in range(5):
        q, g = rng.uniform(-1.0, 1.0, 2), rng.normal(size=3) * 6.0
        x = dict(zip(("shoulder", "elbow", "crank", "rod_pin"), robot.coupling @ q + robot.offset, strict=True))
        oracle = held(PARALLELOGRAM, ["shoulder", "crank"], x, g)
        assert oracle.gap < 1e-10
        assert_allclose(gravity_torque(robot, q, g), oracle.torque, atol=1e-8)
        assert_allclose(mass_matrix(robot, q), oracle.mass, atol=1e-8)


def test_loops_that_no_tree_has_and_motors_that_do_not_move_all_are_refused(written):
    with pytest.raises(UnsupportedModelError, match=re.escape('robot "robot": loop pin: a loop cannot be represented')):
        load_robot(written(FOUR_BAR))
    with pytest.raises(UnsupportedModelError, match=r"2 joints move by themselves.*motors: crank; joints: crank, coup"):
        load_closed_robot(written(FOUR_BAR.replace('<motor joint="wrist"/>', "")))
    apart = FOUR_BAR.replace('body2="rocker_link" anchor="0.5 0 0"', 'body2="world" anchor="0.5 0 0"')
    with pytest.raises(UnsupportedModelError, match="motors: crank, wrist"):
        load_closed_robot(written(apart))
    with pytest.raises(InputError, match="has no loop to close"):
        load_closed_robot(written('<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'))


def test_places_beyond_a_dead_centre_are_refused(written):
    robot = load_closed_robot(written(SLIDER_CRANK))
    with pytest.raises(InputError, match=r'robot "robot": loop head (does not close|is at a dead centre) with slide'):
        robot.gravity_torque([0.3], [0, 0, -9.81])
    with pytest.raises(InputError, match=r"is followed 100 rad or m far, not to a place with slide 1e\+16 m"):
        robot.positions([1e16])
