"""A robot moved from a page: what is sent to it, and when nothing is."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.clock import SECOND
from catenary.errors import RobotHeldError
from catenary.teleop.driver import RAMP, TIMEOUT
from catenary.view.shapes import arm_shapes
from catenary.view.shown import NOBODY, Change, ControlTab
from catenary.view.state import ViewState
from catenary.view.watched import ControlledArm, WatchedArm
from oracles.crtk_robot import RobotOnLoopback, robot_over
from oracles.encoded_plant import EncodedPlant
from oracles.ideal_plant import IdealPlant, ideal_robot

START = [0.8, 1.5, 0.4]
FORWARD, BACKWARD = Change("held:q", True), Change("held:a", True)


class PressedPage:
    """A page on which buttons are pressed at ticks of the robot, and held between them."""

    def __init__(
        self, plant: IdealPlant, ticks: int, pressed: dict[int, Change], held: tuple[int, int] = (0, 0)
    ) -> None:
        self.plant, self._ticks, self._pressed, self._held = plant, ticks, pressed, held
        self.states: list[ViewState] = []

    @property
    def is_running(self) -> bool:
        return self.plant.ticks < self._ticks

    def put(self, state: ViewState) -> None:
        self.states.append(state)

    def changes(self) -> list[Change]:
        tick = self.plant.ticks
        found = [self._pressed[tick]] if tick in self._pressed else []
        if self._held[0] <= tick < self._held[1] and tick % 50 == 0:
            found.append(FORWARD)
        return found


def control(
    pressed: dict[int, Change] | None = None,
    *,
    held: tuple[int, int] = (0, 0),
    ticks: int = 1000,
    kind: type[IdealPlant] = IdealPlant,
    **options: object,
) -> tuple[IdealPlant, PressedPage]:
    robot = ideal_robot(START, kind=kind, **options)
    plant = robot.plant
    assert isinstance(plant, IdealPlant)
    page = PressedPage(plant, ticks, pressed or {}, held)
    ControlledArm(robot, arm_shapes(robot.model), clock=lambda: plant.time).run(page)
    return plant, page


def moved_until(plant: IdealPlant) -> float:
    """Time of the last setpoint that moved, counted in those that were sent [s]."""
    shoulder = np.array(plant.setpoints)[:, 0]
    return float(np.flatnonzero(np.diff(shoulder))[-1]) * plant.period


def test_nothing_is_sent_until_a_button_is_pressed_and_the_end_pauses_the_robot() -> None:
    plant, page = control(ticks=300)
    # holding where it is, on the way out, is all
    assert_allclose(plant.setpoints, [START])
    assert "hold a button to move" in page.states[-1].mode
    assert plant.operating_state().state == "PAUSED"


def test_held_button_moves_its_joint_and_letting_go_stops_it() -> None:
    plant, _ = control(held=(100, 600))
    assert plant.q[0] > START[0] + 0.01
    assert_allclose(plant.q[1:], START[1:])
    # repeats come until 0.55 s, 0.45 s after the first
    assert moved_until(plant) <= 0.45 + TIMEOUT + RAMP + 0.01
    back, _ = control({100: BACKWARD, 150: BACKWARD, 200: BACKWARD})
    assert back.q[0] < START[0] - 0.005


@pytest.mark.parametrize(
    "press", [Change("stop:joints", "stop"), Change("level:joints", "pause"), Change("level:tip", "disable"), NOBODY]
)
def test_motion_ends_at_once(press: Change) -> None:
    plant, _ = control({300: press}, held=(100, 300))
    assert moved_until(plant) <= 0.2 + 0.002


def test_closed_browser_leaves_the_robot_held_and_paused() -> None:
    _, page = control({300: NOBODY}, held=(100, 250), ticks=1000)
    assert page.states[10].time < 0.6
    assert page.states[10].mode == "PAUSED, homed"


def falls(state: str) -> type[IdealPlant]:
    """A robot that is in another state from 0.3 s on."""

    class Falling(IdealPlant):
        def wait(self) -> None:
            super().wait()
            if self.ticks == 300:
                self.state = self.state._replace(state=state)

    return Falling


class Held(IdealPlant):
    """A robot that another program moves."""

    def servo_jp(self, q: np.ndarray) -> None:
        raise RobotHeldError("planner holds the arm")


@pytest.mark.parametrize(
    ("options", "most", "said"),
    [
        ({"pause_after": 400}, 302, "PAUSED"),
        ({"kind": falls("FAULT")}, 202, "does not move"),
        ({"kind": falls("DISABLED")}, 202, "does not move"),
        ({"kind": Held}, 0, "planner holds the arm"),
    ],
    ids=["pauses by itself", "in fault", "disabled", "another program's"],
)
def test_robot_that_is_not_to_be_moved_is_sent_nothing_while_the_button_is_still_held(options, most, said) -> None:
    plant, page = control(held=(100, 900), **options)
    assert len(plant.setpoints) <= most
    assert any(said in state.mode for state in page.states)


def test_robot_that_is_not_homed_is_not_moved_and_home_is_asked_for_twice() -> None:
    plant, _ = control({10: Change("level:joints", "enable")}, held=(100, 900), ready=False)
    assert plant.setpoints == []
    once = {10: Change("level:joints", "enable"), 100: Change("level:joints", "home")}
    assert not control(once, ready=False)[0].operating_state().is_homed
    assert control({**once, 900: Change("level:tip", "home")}, ready=False)[0].operating_state().is_homed


def test_page_has_buttons_for_joints_and_tip() -> None:
    robot = ideal_robot(START)
    joints, tip = ControlledArm(robot, arm_shapes(robot.model)).shown("x").tabs

    def labels(tab: ControlTab) -> list[str]:
        return [control.label for control in tab.controls if control.kind == "held"]

    assert labels(joints) == ["shoulder +", "shoulder -", "elbow +", "elbow -", "insertion +", "insertion -"]
    assert labels(tip) == ["x +", "x -", "y +", "y -", "z +", "z -"]


@pytest.mark.parametrize("kind", [WatchedArm, ControlledArm])
def test_commands_leave_only_from_a_page_that_controls_and_only_while_a_button_is_held(kind: type[WatchedArm]) -> None:
    plant = EncodedPlant()
    setup = RobotOnLoopback(plant)
    robot, client = robot_over(setup.transport, simulated=True, only_read=kind is WatchedArm)
    begin, start = plant.ticks, plant.setpoint_js().q
    page = PressedPage(plant, begin + 1500, {}, held=(begin + 300, begin + 800))
    counted: list[tuple[int, int]] = []

    def clock() -> float:
        counted.append((plant.ticks - begin, setup.robot.commands))
        return setup.transport.steady() / SECOND

    with client:
        kind(robot, arm_shapes(robot.model), clock=clock).run(page)
    sent = dict(counted)
    assert sent[299] == 0
    if kind is WatchedArm:
        assert setup.robot.commands == 0
        assert_allclose(plant.setpoint_js().q, start)
        return
    assert sent[700] > 100
    assert plant.setpoint_js().q[0] > start[0] + 0.005
    # repeats end at 0.75 s at the latest; then a dead man's time, and the goal is sent until it is reached
    later = [count for tick, count in counted if tick > 1200]
    assert later[0] == later[-1]
    assert plant.operating_state().state == "PAUSED"
