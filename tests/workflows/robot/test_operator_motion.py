import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, LimitError, NotReadyError
from catenary.robots.catalog import load_robot
from catenary.trajectories.calibration_box import CALIBRATION_LOWER, CALIBRATION_UPPER
from catenary.workflows.robot.followed_file import FollowedFile
from catenary.workflows.robot.motion import check_motion
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.operator_motion import (
    follow,
    go_to_joints,
    joints_at,
    random_motion,
    run_random,
)
from oracles.ideal_plant import IdealPlant

START = np.array([0.52, 1.57, 0.40])


def raven(**options: object) -> OperatedRobot:
    """A RAVEN-II without physics, its tool left out."""
    model = load_robot("raven2")
    plant = IdealPlant(
        START, joint_names=model.joint_names, joint_units=model.joint_units,
        lower=model.lower, upper=model.upper, **options,
    )  # fmt: skip
    return OperatedRobot(model.name, plant, model, lambda: 0)


def file_of(q: object, time: object, units: tuple[str, ...] = ("rad",)) -> FollowedFile:
    return FollowedFile("run.csv", None, units, np.array(time, dtype=float), np.array(q, dtype=float))


class InterruptedPlant(IdealPlant):
    """Somebody presses Ctrl-C in its 100th tick."""

    def wait(self) -> None:
        super().wait()
        if self.ticks == 100:
            raise KeyboardInterrupt


def test_an_ideal_robot_arrives_without_error() -> None:
    robot = raven()
    summary = go_to_joints(robot, [0.6, 1.5])
    assert_allclose(summary.q, [0.6, 1.5, START[2]])
    assert_allclose(summary.max_error, 0.0, atol=1e-15)
    assert not summary.interrupted


def test_the_tip_arrives_where_it_was_sent() -> None:
    robot = raven()
    goal = forward_kinematics(robot.model, START).position + np.array([0.01, -0.02, 0.015])
    summary = go_to_joints(robot, joints_at(robot, goal, rng=np.random.default_rng(0)))
    assert_allclose(forward_kinematics(robot.model, summary.q).position, goal, atol=1e-9)


def test_ctrl_c_holds_the_robot_where_it_is() -> None:
    robot = raven()
    plant = InterruptedPlant(START, joint_names=robot.model.joint_names, joint_units=("rad", "rad", "m"))
    summary = go_to_joints(OperatedRobot("raven2", plant, robot.model, lambda: 0), [1.0])
    assert summary.interrupted
    assert plant.operating_state().state == "ENABLED"
    assert_allclose(np.diff(plant.setpoints[-10:], axis=0), 0.0)
    assert START[0] < summary.q[0] < 1.0


def test_nobody_moves_a_robot_that_is_not_ready() -> None:
    robot = raven(ready=False)
    with pytest.raises(NotReadyError):
        go_to_joints(robot, [0.6])
    assert robot.plant.setpoints == []


def test_random_motion_stays_in_the_calibration_box() -> None:
    robot = raven()
    motion = random_motion(robot, 60.0, rng=np.random.default_rng(3))
    q = motion.sample(np.arange(0.0, 60.0, 0.01))[0]
    assert (q >= CALIBRATION_LOWER).all()
    assert (q <= CALIBRATION_UPPER).all()


def test_random_motion_of_any_robot_stays_within_its_limits() -> None:
    model = load_robot("panda")
    plant = IdealPlant(
        0.5 * (model.lower + model.upper), joint_names=model.joint_names, joint_units=model.joint_units,
        lower=model.lower, upper=model.upper,
    )  # fmt: skip
    robot = OperatedRobot("panda", plant, model, lambda: 0)
    check_motion(model, random_motion(robot, 30.0, rng=np.random.default_rng(0)))


def test_random_motion_lasts_as_long_as_it_was_asked_to() -> None:
    robot = raven()
    summary = run_random(robot, 4.0, rng=np.random.default_rng(0))
    assert summary.duration >= 4.0


def test_a_file_is_followed_to_its_end() -> None:
    summary = follow(raven(), file_of([[0.5], [0.7]], [0.0, 2.0]))
    assert_allclose(summary.q[0], 0.7)


@pytest.mark.parametrize(
    ("q", "time", "complaint"),
    [
        ([[0.5], [9.0]], [0.0, 60.0], "outside"),
        ([[0.5], [0.7]], [0.0, 0.1], "velocity"),
        ([[1.57], [1.5]], [0.0, 20.0], "from the start"),
    ],
)
def test_a_file_that_cannot_be_followed_moves_nothing(q: object, time: object, complaint: str) -> None:
    robot = raven()
    with pytest.raises(LimitError, match=complaint):
        follow(robot, file_of(q, time))
    assert robot.plant.setpoints == []


def test_a_far_start_is_gone_to_when_asked() -> None:
    robot = raven()
    far = float(robot.model.upper[1]) - 0.01
    if far - START[1] <= np.deg2rad(60.0):
        far = float(robot.model.lower[1]) + 0.01
    file = FollowedFile("run.csv", ("elbow",), ("rad",), np.array([0.0]), np.array([[far]]))
    summary = follow(robot, file, from_afar=True)
    assert_allclose(summary.q[1], far)


def test_units_that_contradict_the_robot_are_refused() -> None:
    with pytest.raises(InputError, match="is in m"):
        follow(raven(), file_of([[0.4], [0.41]], [0.0, 2.0], units=("m",)))
