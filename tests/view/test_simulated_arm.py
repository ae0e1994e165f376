"""A simulated arm driven as from the page, without one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.control.controllers import CONTROLLERS
from catenary.monitor import Snapshot
from catenary.view.page_content import Change
from catenary.view.simulated_arm import _GO_TO, _OWN_CONTROL, DrivenArm


class Script:
    """A page on which somebody does one thing after the other, each some seconds of the robot's time after the last."""

    def __init__(self, *steps: tuple[float, str, object]) -> None:
        self._steps, self._at = list(steps), 0.0
        self.states: list[Snapshot] = []
        self.is_running = True

    def put(self, state: Snapshot, values: dict[str, object]) -> None:
        self.states.append(state)
        self.values = values
        if not self._steps and state.time - self._since >= self._at:
            self.is_running = False

    def changes(self) -> list[Change]:
        if not self.states:
            return []
        now = self.states[-1].time
        if self._at == 0.0:
            self._since = now
            self._at = 1e-9
        if self._steps and now - self._since >= self._steps[0][0]:
            _, name, value = self._steps.pop(0)
            self._since, self._at = now, 0.3
            return [] if name == "" else [Change(name, value)]
        return []


def drive(arm: DrivenArm, *steps: tuple[float, str, object]) -> list[Snapshot]:
    return driven(arm, *steps).states


def driven(arm: DrivenArm, *steps: tuple[float, str, object]) -> Script:
    # whoever leaves the page leaves the arm paused
    page = Script((0.0, "level", "enable"), *steps)
    arm.run(page)
    return page


@pytest.fixture(scope="module")
def raven() -> DrivenArm:
    return DrivenArm("raven2", rng=np.random.default_rng(1), real_time=False)


@pytest.mark.slow
def test_arm_moves_by_itself_and_goes_where_the_sliders_are(raven: DrivenArm) -> None:
    page = driven(raven, (2.0, "goto:shoulder", 45.0), (0.1, "goto:elbow", 80.0), (6.0, "", None))
    states = page.states
    q = np.array([state.q for state in states])
    assert np.ptp(q[:40], axis=0).max() > 0.01  # within the first two seconds
    assert_allclose(np.rad2deg(states[-1].q[:2]), [45.0, 80.0], atol=0.5)
    assert page.values["motion"] == _GO_TO
    assert "ENABLED, homed" in states[-1].state


@pytest.mark.slow
def test_tilted_base_is_compensated_by_sensed_gravity_and_not_by_that_of_a_level_base(raven: DrivenArm) -> None:
    rest, tilt = (0.1, "motion", "rest"), (0.1, "roll_deg", 60.0)
    shares = {}
    for key in ("sg", "dg"):
        states = drive(raven, (0.1, "controller", CONTROLLERS[key].words), rest, tilt, (3.0, "", None))
        last = states[-1]
        assert_allclose(last.actual[1], -9.81 * np.sin(np.pi / 3.0), rtol=1e-6)
        shares[key] = np.abs(last.feedback[0])
        drive(raven, (0.1, "roll_deg", 0.0), (2.0, "", None))
    assert shares["sg"] > 3.0 * shares["dg"]  # what gravity of a level base leaves to PD


def test_pause_holds_the_arm_and_enable_lets_it_go_on(raven: DrivenArm) -> None:
    states = drive(
        raven, (0.1, "motion", "random motion"), (1.0, "level", "pause"), (0.5, "level", "enable"), (1.0, "", None)
    )
    modes = [state.state for state in states]
    assert any(mode.startswith("PAUSED") for mode in modes)
    assert modes[-1].startswith("ENABLED, homed")
    paused = np.array([state.q for state in states if state.state.startswith("PAUSED")])[2:]
    assert np.ptp(paused, axis=0).max() < 2e-3  # the cables give a little


@pytest.mark.slow
def test_home_takes_the_arm_to_its_stops_and_back_into_the_loop(raven: DrivenArm) -> None:
    states = drive(raven, (0.1, "level", "home"), (25.0, "", None))
    modes = [state.state for state in states]
    assert any("busy" in mode for mode in modes)
    assert modes[-1].startswith("ENABLED, homed")


def test_robots_own_control_takes_over_and_gives_back(raven: DrivenArm) -> None:
    states = drive(raven, (0.2, "controller", _OWN_CONTROL), (1.0, "controller", "PD alone"), (1.0, "", None))
    assert states[-1].state.startswith("ENABLED, homed")
    assert not any("FAULT" in state.state for state in states)


def test_gravity_compensation_alone_tracks_no_setpoint(raven: DrivenArm) -> None:
    states = drive(raven, (0.2, "controller", "gravity compensation alone"), (1.0, "", None))
    assert states[-1].setpoint is None
    assert_allclose(states[-1].feedback, 0.0)
    assert not any("FAULT" in state.state for state in states)
    drive(raven, (0.1, "controller", "PD + sensed gravity (DG)"))


def test_page_says_why_the_arm_is_in_fault() -> None:
    arm = DrivenArm("raven2", rng=np.random.default_rng(1), real_time=False)
    states = drive(arm, (0.1, "payload_kg", 1e5), (0.5, "", None))  # which no slider tells
    assert states[-1].state.startswith("FAULT")
    assert any(
        "in FAULT: the software e-stop tripped at" in warning and "a motor's command was too large" in warning
        for warning in states[-1].warnings()
    )


def test_shown_arm_has_a_slider_for_each_joint_within_its_limits(raven: DrivenArm) -> None:
    shown = raven.shown("x")
    sliders = [c for tab in shown.tabs for c in tab.controls if c.name.startswith("goto:")]
    assert [c.name for c in sliders] == ["goto:shoulder", "goto:elbow", "goto:insertion"]
    assert all(c.options[0] <= c.value <= c.options[1] for c in sliders)
    assert set(shown.legend) == {"reported", "true"}
