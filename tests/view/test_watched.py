import numpy as np
from numpy.testing import assert_allclose

from catenary.open_robot import Simulated, tilted_base
from catenary.view.shapes import arm_shapes
from catenary.view.shown import Change
from catenary.view.state import ViewState
from catenary.view.watched import WatchedArm
from catenary.workflows.robot.operated_robot import operated_robot


class Glance:
    """A page that is looked at for a few states, on which somebody tries to drive the robot."""

    def __init__(self, states: int) -> None:
        self._most, self.states = states, list[ViewState]()

    @property
    def is_running(self) -> bool:
        return len(self.states) < self._most

    def put(self, state: ViewState) -> None:
        self.states.append(state)

    def changes(self) -> list[Change]:
        return [Change("goto:shoulder", 60.0), Change("level", "pause")]


def test_robot_is_shown_and_never_moved() -> None:
    robot = operated_robot("raven2", Simulated(base=tilted_base((30.0, 0.0))))
    before = robot.plant.measured_js().q
    watched, page = WatchedArm(robot, arm_shapes(robot.model)), Glance(5)
    assert watched.shown("x").tabs == ()
    watched.run(page)
    assert len(page.states) == 5
    last = page.states[-1]
    assert_allclose(last.q, before[:3], atol=1e-3)
    assert_allclose(last.gravity, [0.0, -9.81 * np.sin(np.pi / 6.0), -9.81 * np.cos(np.pi / 6.0)], atol=1e-6)
    assert last.mode == "ENABLED, homed"
    assert np.isfinite(last.true).all()
