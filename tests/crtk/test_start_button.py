"""The silver button, by its topic."""

import pytest

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.start_button import press_button
from catenary.errors import TransportError
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.simulation.cable_plant import JOINTS, UNITS
from oracles.cable_arms import homed_plant
from oracles.ticking_clock import SetClock, TickingClock
from served_robot import homing_plant


class Raven(TickingClock):
    """A served RAVEN-II that ticks while somebody sleeps, and a client of it."""

    def __init__(self) -> None:
        super().__init__(0.001, 1_700_000_000 * 10**9)
        network = LoopbackNetwork(clock=self)
        carrier, self.client = Loopback("robot", network), Loopback("client", network)
        parked = ParkedArm(JOINTS, UNITS, homed_plant("left").firmware.home_value)
        self.plant = homing_plant()
        self.server = make_server(Serving(), carrier, plants={"gold": self.plant, "green": parked})

    def tick(self) -> None:
        self.server.tick()


def test_it_starts_the_robot_and_says_what_it_did() -> None:
    robot = Raven()
    robot.sleep(0.2)  # it looks ten times a second at who is there
    assert press_button(robot.client) == (True, "gold: starts")
    robot.sleep(0.05)
    assert robot.plant.operating_state().is_busy
    success, said = press_button(robot.client)
    assert not success
    assert said == "gold: the arm is ENABLED already"


def test_where_nobody_has_one_it_says_so() -> None:
    lonely = Loopback("client", LoopbackNetwork(clock=SetClock()))
    with pytest.raises(TransportError, match="nobody listens"):
        press_button(lonely)
