"""A loop ends safely when a joint is faster than it may be, or the reference leaps; what is meant goes on."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.arrays import Floats
from catenary.control.loop import Tick, run_loop
from catenary.control.pd import GravityHold, InertiaPD, JointPD
from catenary.errors import InputError, LimitError
from catenary.gravity.payload import Payload
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.trajectories.reference import Reference, Rest
from oracles.ideal_plant import MassPlant

ZERO = np.zeros(2)
PD = JointPD([400.0, 400.0], [40.0, 40.0])
FREE = JointPD(ZERO, ZERO)


class MovingPlant(MassPlant):
    """Moves as it is told, whatever torques it gets: q(t), the second joint a slide; its clock shows `stamp(t)`."""

    def __init__(self, q: Callable[[float], float], *, stamp: Callable[[float], float] = float, **stated: Any) -> None:
        super().__init__(ZERO)
        self.joint_units = ("rad", "m")
        self.at, self.stamp = q, stamp
        vars(self).update(stated)

    def measured_js(self) -> JointState:
        told = self.stamp(self.time)
        return super().measured_js()._replace(time=told, q=np.array([self.at(told), 0.0]))


def moved(plant: MassPlant, seconds: float = 1.0, **options: Any) -> str:
    """What ends a loop without torques on a plant; nothing where it ends by itself."""
    try:
        run_loop(plant, FREE, Rest(ZERO, seconds), **options)
    except LimitError as error:
        assert plant.state.state == "PAUSED"
        assert [verb for verb, _ in plant.log[-2:]] == ["servo_jp", "state_command"]
        return str(error)
    return ""


@pytest.mark.parametrize("robot", ["ur5e", "panda"])
def test_an_arm_with_a_load_that_nobody_told_does_not_fall(robot: str) -> None:
    model = load_robot(robot)
    q = np.zeros(model.n) if robot == "ur5e" else np.array([0.0, 0.9, 0.0, -0.6, 0.0, 1.5, 0.0])
    plant = MujocoPlant(model, start=q, payload=Payload(5.0))
    plant.home()
    with pytest.raises(LimitError, match=r'joint ".*" moves at [\d.]+ rad/s, expected at most') as caught:
        run_loop(plant, GravityHold(model), Rest(q, 3.0))
    assert plant.operating_state().state == "PAUSED"
    fell = np.abs(plant.measured_js().q - q).max()
    assert fell < 1.0  # from rest to some 3 rad/s; half a turn without the guard
    assert "the control loop ended after" in caught.value.__notes__[0]


@pytest.mark.parametrize(
    ("stated", "options", "most"),
    [
        ({}, {}, 2.0),
        ({"velocity_limit": np.array([0.5, 0.1])}, {}, 0.6),
        ({"velocity_limit": np.array([np.inf, 0.1])}, {}, 2.0),
        ({"velocity_limit": np.array([0.0, 0.1])}, {}, 2.0),  # files that state zero mean that nobody knows
        ({"velocity_limit": np.array([0.5, 0.1])}, {"max_speed": 3.0}, 3.0),
        ({}, {"max_speed": [4.0, 0.1]}, 4.0),
        ({"joint_units": ("m", "m")}, {}, 0.5),
    ],
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_joint_may_be_as_fast_as_the_robot_says_or_is_told(
    stated: Any, options: Any, most: float, way: float
) -> None:
    assert moved(MovingPlant(lambda t: 0.98 * way * most * t, **stated), 0.5, **options) == ""
    told = moved(MovingPlant(lambda t: 1.02 * way * most * t, **stated), 0.5, **options)
    speed = re.match(r'joint "j0" moves at ([\d.]+) (rad|m)/s, expected at most ([\d.]+)', told)
    assert speed is not None, told
    assert float(speed[1]) == pytest.approx(1.02 * most, rel=1e-3)
    assert float(speed[3]) == pytest.approx(most)


def test_infinity_lets_any_joint_go_and_any_reference_leap() -> None:
    assert moved(MovingPlant(lambda t: 50.0 * t), max_speed=np.inf) == ""
    run_loop(MassPlant(ZERO), PD, Leap(0.8), max_speed=np.inf)


@pytest.mark.parametrize("given", [0.0, -1.0, np.nan, [1.0, 2.0, 3.0], "fast"])
def test_impossible_speeds_are_refused(given: Any) -> None:
    plant = MassPlant(ZERO)
    with pytest.raises(InputError, match="max_speed"):
        run_loop(plant, FREE, Rest(ZERO, 0.1), max_speed=given)
    assert plant.log == []


@pytest.mark.parametrize("rate_hz", [1000.0, 100.0, 25.0])
def test_a_fall_is_seen_within_some_ticks_or_a_twentieth_of_a_second(rate_hz: float) -> None:
    plant = MovingPlant(lambda t: 0.5 * 20.0 * max(0.0, t - 0.2) ** 2)  # 2 rad/s after 0.1 s
    assert moved(plant, 2.0, rate_hz=rate_hz)
    assert plant.time < 0.3 + max(0.05, 4.0 / rate_hz)


@pytest.mark.parametrize("ticks", [1, 3, 8])
@pytest.mark.parametrize("size", [0.1, np.nan])
def test_a_spike_of_an_encoder_that_returns_is_no_speed(ticks: int, size: float) -> None:
    assert moved(MovingPlant(lambda t: size if 0.5 <= t < 0.5 + (ticks - 0.5) * 0.001 else 0.0)) == ""


def test_positions_that_are_lost_now_and_then_hide_no_speed() -> None:
    assert moved(MovingPlant(lambda t: np.nan if round(1000.0 * t) % 10 == 3 else 2.1 * t))


@pytest.mark.parametrize("stamp", [lambda t: np.floor(t / 0.03) * 0.03, lambda t: np.floor(t / 0.01) * 0.01])
def test_states_that_come_in_bursts_are_no_leaps(stamp: Callable[[float], float]) -> None:
    assert moved(MovingPlant(lambda t: 1.9 * t, stamp=stamp)) == ""
    assert moved(MovingPlant(lambda t: 2.2 * t, stamp=stamp))


class Leap:
    """Stands at zero, and somewhere else from half a second on."""

    duration = 1.0

    def __init__(self, size: float, *, lost: bool = False) -> None:
        self.size, self.lost = size, lost

    def __call__(self, t: float) -> Reference:
        q = np.array([0.0, self.size if t >= 0.5 else 0.0])
        if self.lost and 0.45 <= t < 0.455:
            q[1] = np.nan
        return Reference(q, ZERO, ZERO)

    def sample(self, times: Any) -> tuple[Floats, Floats, Floats]:
        q = np.array([self(float(t)).q for t in times])
        return q, 0.0 * q, 0.0 * q


@pytest.mark.parametrize("controller", [PD, None])
@pytest.mark.parametrize("size", [0.8, -0.03])
def test_a_reference_that_leaps_ends_the_loop_before_it_is_sent(controller: JointPD | None, size: float) -> None:
    plant = MassPlant(ZERO)
    with pytest.raises(LimitError, match=rf'joint "j1": the reference leaps by {abs(size)} rad between two ticks'):
        run_loop(plant, controller, Leap(size))
    sent = [values for verb, values in plant.log if verb in ("servo_jf", "servo_jp")]
    assert_array_equal(sent, np.zeros((501, 2)))  # 500 ticks, and the hold
    assert plant.state.state == "PAUSED"


def test_a_reference_that_is_lost_meanwhile_leaps_all_the_same() -> None:
    with pytest.raises(LimitError, match=r"the reference leaps by 0\.8 rad"):
        run_loop(MassPlant(ZERO), PD, Leap(0.8, lost=True))


@pytest.mark.parametrize("rate_hz", [1000.0, 20.0])
def test_a_reference_at_the_largest_speed_is_no_leap(rate_hz: float) -> None:
    class Ramp(Leap):
        def __call__(self, t: float) -> Reference:
            return Reference(np.full(2, 1.99 * t), ZERO + 1.99, ZERO)

    run_loop(MassPlant(ZERO), FREE, Ramp(0.0), rate_hz=rate_hz)


def test_a_motion_at_a_robots_own_limits_goes_on() -> None:
    model = load_robot("panda")
    plant = MujocoPlant(model, start=0.5 * (model.lower + model.upper) + 0.3)
    plant.home()
    start, seen = plant.measured_js().q, list[Tick]()

    class Sine(Leap):
        duration = 4.0

        def __call__(self, t: float) -> Reference:
            w = np.pi
            size = 0.99 * model.velocity_limit / w
            return Reference(
                start + size * (np.cos(w * t) - 1.0), -size * w * np.sin(w * t), -size * w**2 * np.cos(w * t)
            )

    run_loop(plant, InertiaPD(model, 1600.0, 80.0), Sine(0.0), observers=[seen.append])
    fastest = np.abs([tick.state.qd for tick in seen]).max(axis=0)
    assert (fastest > 0.8 * model.velocity_limit).any()
