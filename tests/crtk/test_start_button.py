"""The silver button, by its topic."""

import pytest

from catenary.crtk.client import press_button
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.errors import TransportError
from oracles.ticking_clock import SetClock
from served_robot import ServedRobot, homing_plant


def test_it_starts_the_robot_and_says_what_it_did() -> None:
    robot = ServedRobot(plant=homing_plant())
    robot.tick_while_slept()
    robot.clock.sleep(0.2)  # it looks ten times a second at who is there
    assert press_button(robot.client) == (True, "gold: starts")
    robot.clock.sleep(0.05)
    assert robot.plant.operating_state().is_busy
    success, said = press_button(robot.client)
    assert not success
    assert said == "gold: the arm is ENABLED already"


def test_where_nobody_has_one_it_says_so() -> None:
    lonely = Loopback("client", LoopbackNetwork(clock=SetClock()))
    with pytest.raises(TransportError, match="nobody listens"):
        press_button(lonely)
