"""Gravity compensation tried on simulated arms: tracking, and holding."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.control.controllers import HOLDS, make_controller
from catenary.control.loop_report import Holding
from catenary.control.pd import Controller
from catenary.errors import InputError, LimitError
from catenary.plant import AT_REST, JointState
from catenary.robots.catalog import load_robot
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import FixedBase, MovingBase, RockingBase, SwayingBase, Wave
from catenary.simulation.cable_parameters import RAVEN2_STIFF, load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.trajectories.reference import Reference, Rest
from catenary.trajectories.smoothed_path import go_to
from catenary.workflows.gravity_trials import (
    HOLD_START,
    SimulatedArm,
    base_sensor,
    hold_arm,
    make_motion,
    poses_along,
    raven_arm,
    simulated_arm,
    track,
)

AT = np.array([0.2, np.pi / 2, 0.40])


def of_2014(base: MovingBase) -> SimulatedArm:
    """The gravity paper's robot, whose friction hides little of what gravity does."""
    plant = CablePlant(load_cable_arm(RAVEN2_STIFF), base=base)
    plant.home()
    return raven_arm(plant)


@pytest.fixture(scope="module")
def tilted() -> SimulatedArm:
    return of_2014(FixedBase(0.0, -0.35))


def test_measures_are_of_the_ticks_that_count(tilted: SimulatedArm) -> None:
    fastest = {"max_velocity": [0.3, 0.3, 0.02], "max_acceleration": [1.0, 1.0, 0.1]}
    way = go_to(AT, AT + np.array([0.1, 0.0, 0.0]), **fastest)
    result = track(tilted, make_controller("dg", tilted), way, windows=[(0.2, 0.4)])
    kept = (result.time >= 0.2 - 1e-9) & (result.time <= 0.4 + 1e-9)
    assert result.counted.sum() == kept.sum() == 201
    assert_allclose(result.rms_error, np.sqrt(np.mean(result.error[kept] ** 2, axis=0)))
    squares = (np.mean(part[kept] ** 2, axis=0) for part in (result.feedback, result.torque))
    assert_allclose(result.pd_share, np.sqrt(np.divide(*squares)))
    assert result.time[0] == pytest.approx(0.0, abs=1e-9)
    assert result.time[-1] == pytest.approx(way.duration, abs=1e-3)


def test_a_motion_out_of_reach_moves_nothing(tilted: SimulatedArm) -> None:
    before = tilted.plant.measured_js()
    with pytest.raises(LimitError):
        track(tilted, make_controller("dg", tilted), Rest([2.0, 1.5, 0.4], 1.0))
    with pytest.raises(InputError, match="windows"):
        track(tilted, make_controller("dg", tilted), Rest(AT, 1.0), windows=[(0.5, 2.0)])
    assert tilted.plant.measured_js().time == before.time


def test_poses_count_only_at_rest() -> None:
    model = load_robot("raven2")
    motion = poses_along(model, 0, [0.2, 0.6, 1.0], AT)
    assert motion.windows is not None
    assert len(motion.windows) == 3
    for first, last in motion.windows:
        q, qd, _ = motion.trajectory.sample(np.linspace(first, last, 50))
        assert_allclose(qd, 0.0, atol=1e-12)
        assert_allclose(q, q[:1].repeat(50, axis=0), atol=1e-12)


def test_a_robot_without_limits_is_told_to_state_a_start() -> None:
    model = load_robot("two_link")
    for name in ("cartesian", "random", "poses"):
        with pytest.raises(InputError, match=r'joint "link0": has no limits'):
            make_motion(name, model, model, np.random.default_rng(1))


@pytest.mark.parametrize(
    ("name", "start", "options"),
    [("raven2", [0.7, 1.5, 0.35], {"amplitude": 0.02}), ("two_link", [0.4, 0.9], {"amplitude": 0.1, "axes": ("x", "z")})],
)  # fmt: skip
def test_sinusoids_begin_where_asked_along_axes_it_has(name: str, start: list[float], options: dict) -> None:
    model, rng = load_robot(name), np.random.default_rng(1)
    trajectory = make_motion("cartesian", model, model, rng, q_start=start, **options).trajectory
    assert_allclose(trajectory(0.0).q, start, atol=1e-9)
    assert trajectory.duration > 0.0


POSE = (0.9, np.pi / 2, 0.40)


def arm_at(angle_deg: float) -> SimulatedArm:
    """An arm homed on a base turned about the mechanism's z0, which is the base's -y."""
    return of_2014(FixedBase(0.0, float(-np.deg2rad(angle_deg))))


def held(angle_deg: float, controller: str, seconds: float) -> Holding:
    arm = arm_at(angle_deg)
    return hold_arm(arm, make_controller(controller, arm, among=HOLDS), POSE, seconds)


def test_sensed_gravity_holds_and_nominal_gravity_does_not_on_a_tilted_base() -> None:
    assert np.rad2deg(held(25.0, "dg", 1.0).drift[0]) < 0.1
    assert np.rad2deg(held(25.0, "sg", 1.0).drift[0]) > 5.0


class WithoutRates:
    """A controller that is not told how the base turns, as with an accelerometer alone."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    def torque(self, state: JointState, reference: Reference) -> Floats:
        return self.controller.torque(state._replace(base_rates=AT_REST), reference)


@pytest.mark.slow
def test_rates_of_a_rocking_base_keep_the_arm_where_an_accelerometer_alone_does_not() -> None:
    rocking = RockingBase(np.deg2rad(15.0), np.deg2rad(5.0), 1.0, axis=(0.0, 1.0, 0.0))
    drift = {}
    for blind in (False, True):
        arm = of_2014(rocking)
        controller = make_controller("dg", arm, among=HOLDS)
        drift[blind] = hold_arm(arm, WithoutRates(controller) if blind else controller, POSE, 3.0).drift[0]
    assert drift[False] < 0.25 * drift[True]
    assert np.rad2deg(drift[True]) > 2.0


def test_a_pose_beyond_the_limits_or_no_time_at_all_is_refused() -> None:
    arm = arm_at(0.0)
    with pytest.raises(LimitError, match="outside"):
        hold_arm(arm, make_controller("dg", arm, among=HOLDS), [2.0, 1.5, 0.4], 1.0)
    with pytest.raises(InputError, match="seconds"):
        hold_arm(arm, make_controller("dg", arm, among=HOLDS), POSE, 0.0)


@pytest.mark.slow
def test_joint_one_slips_where_its_reported_position_is_off_and_not_where_it_is_known() -> None:
    reported, known = (
        np.rad2deg(
            hold_arm(arm, make_controller("dg", arm, among=HOLDS), HOLD_START, 2.0, calibrated=calibrated).drift[0]
        )
        for arm, calibrated in ((arm_at(-25.0), False), (arm_at(-25.0), True))
    )
    assert 0.05 < reported < 0.5  # friction is at its edge: it depends on every number of the plant
    assert known < 0.01


def test_an_arm_whose_joints_are_known_holds_by_a_cheap_sensor_on_a_base_that_rocks_far() -> None:
    base = SwayingBase((Wave(np.deg2rad(45.0), 0.2, (1.0, 0.0, 0.0)),))
    drift = []
    for sensed in (True, False):
        arm = simulated_arm("raven2", base=base)
        sensor, told = base_sensor(base, start=arm.plant.measured_js().time)
        source = SensedGravity(sensor.mailbox, told, feed=sensor.advance) if sensed else None
        held = hold_arm(arm, make_controller("dg", arm, among=HOLDS), HOLD_START, 4.0, gravity=source, calibrated=True)
        drift.append(np.rad2deg(held.drift[:2]))
    assert drift[0].max() < 0.7  # cables rub, and creep
    assert_allclose(*drift, atol=0.1)  # true gravity holds no better
