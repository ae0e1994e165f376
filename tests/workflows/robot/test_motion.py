from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError, LimitError, NotReadyError, UnsupportedCommandError
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference
from catenary.trajectories.smoothed_path import SmoothedPath, go_to
from catenary.trajectories.zigzag import zigzag
from catenary.workflows.robot.motion import GENTLE_VELOCITY, check_motion, move_to, run_trajectory
from oracles.ideal_plant import IdealPlant

ARM = {
    "joint_names": ("shoulder", "elbow", "insertion", "roll"),
    "joint_units": ("rad", "rad", "m", "rad"),
    "lower": [0.0, 0.8, 0.23, -3.0],
    "upper": [1.6, 2.4, 0.56, 3.0],
}


def arm(q: tuple[float, ...] = (0.5, 1.5, 0.4, 0.1), **options: object) -> IdealPlant:
    return IdealPlant(q, **{**ARM, "period": 0.01, **options})


def swing(n: int = 1, start: float = 0.5, size: float = 0.4) -> SmoothedPath:
    return SmoothedPath.through([0.0, 2.0, 4.0], np.tile([[start], [start + size], [start]], n), 0.5)


def test_plant_is_sent_the_trajectory_tick_by_tick() -> None:
    plant = IdealPlant([0.5, 0.5], period=0.01)
    trajectory = swing(2)
    run_trajectory(plant, trajectory)
    times = 0.01 * np.arange(1, 451)
    assert_array_equal(plant.setpoints, trajectory.sample(times)[0])
    assert plant.ticks == 450
    assert_array_equal(plant.measured_js().q, trajectory(trajectory.duration).q)


def test_plant_elsewhere_first_goes_to_the_start_gently() -> None:
    plant = IdealPlant([-0.5], period=0.01)
    run_trajectory(plant, swing())
    sent = np.array([[-0.5], *plant.setpoints])
    speeds = np.abs(np.diff(sent[:, 0])) / 0.01
    there = int(np.argmin(np.abs(sent[:, 0] - 0.5)))
    assert speeds[:there].max() == pytest.approx(GENTLE_VELOCITY["rad"])
    approach = len(sent) - 1 - 450
    assert_allclose(sent[approach], [0.5], atol=1e-12)
    assert_allclose(sent[approach + 1 :], swing().sample(0.01 * np.arange(1, 451))[0])


def test_approach_keeps_a_velocity_bound_below_the_gentle_one() -> None:
    plant = IdealPlant([0.4], period=0.01)
    run_trajectory(plant, swing(size=0.1), max_velocity=[0.06])
    assert np.abs(np.diff(plant.setpoints, axis=0)).max() / 0.01 <= 0.06 * (1.0 + 1e-9)


def test_joints_that_are_not_named_hold_their_setpoint() -> None:
    plant = arm()
    trajectory = SmoothedPath.through([0.0, 2.0], [[0.4, 0.5], [0.45, 0.7]], 0.5)
    run_trajectory(plant, trajectory, joints=["insertion", "shoulder"])
    sent = np.array(plant.setpoints)
    assert_array_equal(sent[:, [1, 3]], np.tile([1.5, 0.1], (len(sent), 1)))
    assert_allclose(sent[-1, [2, 0]], [0.45, 0.7])


def test_observers_see_what_was_measured_and_what_was_commanded() -> None:
    plant = arm()
    trajectory = swing()
    seen: list[tuple[JointState, Reference, float]] = []
    run_trajectory(plant, trajectory, joints=["shoulder"], observe=lambda *each: seen.append(each))
    assert len(seen) == plant.ticks
    for k, (state, sent, time) in enumerate(seen):
        assert time == pytest.approx((k + 1) * 0.01)
        wanted = trajectory((k + 1) * 0.01)
        assert state.time == pytest.approx((k + 1) * 0.01)
        assert_array_equal(state.q, sent.q)
        assert_array_equal([values[0] for values in sent], [values[0] for values in wanted])
        assert_array_equal(sent.q[1:], [1.5, 0.4, 0.1])
        assert_array_equal([*sent.qd[1:], *sent.qdd[1:]], 0.0)


def test_observers_are_told_when_the_motion_begins() -> None:
    plant = arm()
    seen: list[float] = []
    plant.servo_jp(plant.setpoint_js().q + 0.01)
    plant.wait()
    run_trajectory(plant, swing(), joints=["shoulder"], observe=lambda _, __, time: seen.append(time))
    assert seen[0] < 0.0
    assert_allclose(np.diff(seen), 0.01)
    assert np.abs(seen).min() < 1e-9
    assert seen[-1] == pytest.approx(swing().duration, abs=0.01)


@pytest.mark.parametrize("command", ["disable", "pause", "unhome"])
def test_robot_that_is_not_ready_is_refused_before_anything_moves(command: str) -> None:
    plant = IdealPlant([0.0])
    plant.state_command(command)
    for move in (lambda: run_trajectory(plant, swing()), lambda: move_to(plant, [0.1])):
        with pytest.raises(NotReadyError, match="nothing has moved"):
            move()
    assert (plant.setpoints, plant.ticks) == ([], 0)


BEYOND = r'joint "shoulder" at 1\.7\d+ s: position 1.6\d+ rad outside \[0, 1.6\]'


@pytest.mark.parametrize(
    ("options", "start", "error", "message", "sent"),
    [
        ({"pause_after": 120}, 0.5, NotReadyError, r"stopped 1.200 s into a motion of 4.500 s: the robot is PAUSED", 120),
        ({"supports": frozenset({"servo_jr", "x"})}, 0.5, UnsupportedCommandError, r"no servo_jp.*servo_jr, x", 0),
        ({}, 1.3, LimitError, BEYOND, 0),
    ],
)  # fmt: skip
def test_motion_ends_where_it_must(options: Any, start: float, error: Any, message: str, sent: int) -> None:
    plant = arm(q=(start, 1.5, 0.4, 0.1), **options)
    with pytest.raises(error, match=message):
        run_trajectory(plant, swing(start=start), joints=["shoulder"])
    assert len(plant.setpoints) == sent


SPIKE = SmoothedPath.through([0.0, 50.0, 50.1, 50.2, 100.0], [[0.5], [0.5], [1.9], [0.5], [0.5]], 0.05)
BEYOND_AT_ITS_END = go_to([1.5], [1.6 + 2e-9], max_velocity=[0.1], max_acceleration=[1.0])


@pytest.mark.parametrize(
    ("motion", "options", "message"),
    [
        (SPIKE, {}, r"at 50\.\d+ s"),
        (BEYOND_AT_ITS_END, {}, r"1.6 rad outside"),
        (swing(), {"max_velocity": [0.15]}, r'"shoulder" at 0\.\d+ s: velocity 0.1\d+ rad/s beyond 0.15 rad/s'),
    ],
)  # fmt: skip
def test_excursions_last_instant_and_velocity_are_checked(motion, options, message) -> None:
    with pytest.raises(LimitError, match=message):
        check_motion(arm(), motion, joints=["shoulder"], **options)
    check_motion(arm(), swing(), joints=["shoulder"], max_velocity=[0.2])


def test_robot_models_have_limits_too() -> None:
    model = load_robot("raven2")
    check_motion(model, zigzag("J1-J2-J3", [1 / 2]))
    with pytest.raises(LimitError, match="insertion"):
        check_motion(model, zigzag("J3", [1 / 2], upper=[1.0, 1.9, 0.9]))


def test_go_to_arrives_and_sends_nothing_where_the_robot_is() -> None:
    plant = arm()
    seen: list[float] = []
    move_to(plant, [0.5, 1.5, 0.4, 0.1], progress=seen.append)
    assert plant.setpoints == []
    assert seen[-1] == 1.0
    move_to(plant, [0.3, 2.0], joints=["roll", "elbow"], max_velocity=[1.0, 1.0])
    assert_allclose(plant.measured_js().q, [0.5, 2.0, 0.4, 0.3])
    assert np.abs(np.diff(plant.setpoints, axis=0)).max() <= 0.01 * (1.0 + 1e-9)


def test_go_to_leads_back_from_beyond_a_limit_but_not_there() -> None:
    plant = arm(q=(0.5, 2.45, 0.4, 0.1))  # homed against a stop
    move_to(plant, [0.5, 2.0, 0.4, 0.1])
    assert_allclose(plant.measured_js().q[1], 2.0)
    with pytest.raises(LimitError, match=r'"elbow".* outside'):
        move_to(plant, [0.5, 2.45, 0.4, 0.1])


SHOULDER = ["shoulder"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joints": ["knee"]}, "expected different names among shoulder, elbow"),
        ({"joints": ["roll", "roll"]}, "expected different names"),
        ({"joints": ["roll", "elbow"]}, "the trajectory moves 1; expected as many names, got 2: roll, elbow"),
        ({"joints": []}, "the trajectory moves 1"),
        ({"joints": None}, "the trajectory moves 1; expected as many names, got 4"),
        ({"joints": SHOULDER, "max_velocity": [0.0]}, "max_velocity: expected more than 0"),
        ({"joints": SHOULDER, "max_velocity": [1.0, 1.0]}, r"max_velocity: expected shape \(1,\)"),
    ],
)
def test_joints_and_bounds_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    plant = arm()
    for move in (check_motion, run_trajectory):
        with pytest.raises(InputError, match=message):
            move(plant, swing(), **options)
    assert plant.setpoints == []


@pytest.mark.parametrize("q", [[0.1], [0.1, np.nan, 0.1, 0.1], "home"])
def test_goal_that_is_none_is_refused(q: object) -> None:
    with pytest.raises(InputError, match="q"):
        move_to(arm(), q)
