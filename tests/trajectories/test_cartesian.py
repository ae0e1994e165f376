import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, LimitError
from catenary.robots.catalog import load_robot
from catenary.spatial import Pose
from catenary.trajectories.cartesian import AMPLITUDE_M, CartesianSinusoids

MIDDLE = [np.deg2rad(45.0), np.deg2rad(90.0), 0.3]
STARTS = {"raven2": MIDDLE, "raven2_right": MIDDLE, "raven2_full": [*MIDDLE, 0.0, 0.0, 0.0]}


@pytest.mark.parametrize("name", STARTS)
def test_tip_follows_a_sine_along_each_axis_in_turn(name: str) -> None:
    model = load_robot(name)
    motion = CartesianSinusoids(model, STARTS[name])
    start = forward_kinematics(model, STARTS[name])
    times = np.linspace(0.0, motion.duration, 3001)
    q, _, _ = motion.sample(times)
    rotations, positions = forward_kinematics(model, q)
    for axis in range(3):
        turn = (times >= 9.0 * axis) & (times <= 9.0 * (axis + 1))
        others = [other for other in range(3) if other != axis]
        off = positions[turn] - start.position
        assert_allclose(off[:, others], 0.0, atol=1e-7)  # the spline between solutions
        assert_allclose([off[:, axis].min(), off[:, axis].max()], [-AMPLITUDE_M, AMPLITUDE_M], rtol=1e-3)
        # away from the ramps it is a sine of the period asked for
        full = (times >= 9.0 * axis + 1.0) & (times <= 9.0 * axis + 8.0)
        phase = 2.0 * np.pi / 4.0 * (times[full] - 9.0 * axis - 0.5)
        assert_allclose(positions[full, axis] - start.position[axis], AMPLITUDE_M * np.sin(phase), atol=1e-7)
    if model.n == 6:
        assert_allclose(rotations, np.broadcast_to(start.rotation, rotations.shape), atol=1e-6)


def test_other_robots_are_moved_by_search() -> None:
    model = load_robot("planar_3r")
    motion = CartesianSinusoids(model, [0.3, 0.8, 0.5], axes=("z", "x"), amplitude=0.1, period=2.0, cycles=1)
    times = np.linspace(0.0, motion.duration, 501)
    _, positions = forward_kinematics(model, motion.sample(times)[0])
    assert motion.duration == pytest.approx(2 * (2.0 + 0.5))
    assert_allclose(positions, motion.tip_positions(times), atol=1e-6)
    assert_allclose(np.ptp(positions, axis=0), [0.2, 0.0, 0.2], atol=1e-3)


LOW_DOWN = [np.deg2rad(45.0), np.deg2rad(90.0), 0.23]
# its base frame has the remote centre as origin
NEAR_THE_CENTRE = inverse_kinematics(load_robot("raven2"), Pose(np.eye(3), np.array([0.0, 0.0, -0.04])))


@pytest.mark.parametrize(
    ("robot", "start", "options", "message"),
    [
        ("raven2", LOW_DOWN, {}, r'along x, at .* of 27.000 s, .*"insertion".*outside \[0.23'),
        ("raven2", NEAR_THE_CENTRE, {"axes": ("z",), "amplitude": 0.035}, r"along z, .* mm from the remote centre"),
        ("planar_3r", [0.3, 0.8, 0.5], {"axes": ("y",), "amplitude": 0.01}, "along y"),  # out of its plane
        # nearly stretched out: small motions inward need large ones of the joints
        (
            "two_link",
            [0.0, 0.05],
            {"axes": ("x",), "amplitude": 0.0004, "period": 0.01, "cycles": 1, "step": 1e-4},
            r"would move at .* a singularity is near",
        ),
    ],
    ids=["joint limit", "remote centre", "plane of the arm", "joint velocity"],
)
def test_what_stands_in_the_way_is_named(robot, start, options, message) -> None:
    with pytest.raises(LimitError, match=message):
        CartesianSinusoids(load_robot(robot), start, **options)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"amplitude": 0.0}, "amplitude: expected more than 0"),
        ({"period": -1.0}, "period"),
        ({"cycles": 0}, "cycles: expected at least 1"),
        ({"axes": ("w",)}, "axes: expected some of x, y, z"),
        ({"q_start": [0.0, 0.0]}, r"q_start: expected shape \(3,\)"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        CartesianSinusoids(load_robot("raven2"), **{"q_start": MIDDLE, **arguments})
