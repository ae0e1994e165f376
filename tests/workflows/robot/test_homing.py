from typing import Any

import pytest
from numpy.testing import assert_allclose

from catenary.errors import NotReadyError
from catenary.plant import OperatingState, StateCommand
from catenary.robots.catalog import load_robot
from catenary.workflows.robot import homing
from catenary.workflows.robot.homing import AnswerYes, Guide, Homing, home_client, home_operated
from oracles.crtk_robot import RobotOnLoopback, robot_over
from oracles.encoded_plant import OFFSET, EncodedPlant
from oracles.ideal_plant import IdealPlant
from person import Person


class LongHoming(EncodedPlant):
    """Homes until it is told that it has arrived, or is disabled."""

    busy = False

    def state_command(self, command: StateCommand) -> None:
        if command == "home":
            self.busy = True
        elif command == "disable":
            self.busy = False
            super().state_command(command)
        else:
            super().state_command(command)

    def operating_state(self) -> OperatingState:
        return super().operating_state()._replace(is_busy=self.busy)

    def arrive(self) -> None:
        self.busy = False
        super().state_command("home")


def homed(setup: RobotOnLoopback, guide: Guide, **options: Any) -> Homing:
    robot, client = robot_over(setup.transport, **options)
    with client:
        return home_operated(robot, guide)


def test_a_person_clears_the_workspace_then_presses_the_button() -> None:
    setup = RobotOnLoopback(EncodedPlant(ready=False))
    person = Person(button=lambda: setup.robot._press(None))
    found = homed(setup, person)
    assert ["workspace" in person.asked[0], "start button" in person.asked[1]] == [True, True]
    assert found.was_run
    assert found.state.is_homed


def test_external_encoders_are_reported_beside_what_the_robot_believes() -> None:
    found = homed(RobotOnLoopback(EncodedPlant(ready=False)), AnswerYes(), simulated=True)
    assert found.external_encoders is not None
    assert_allclose(found.external_encoders - found.believed[:3], OFFSET, atol=1e-6)


def test_a_homed_robot_is_left_alone_and_nobody_is_asked() -> None:
    setup = RobotOnLoopback(EncodedPlant())
    person = Person()
    assert not homed(setup, person).was_run
    assert person.asked == []
    assert setup.robot.commands == 0


def test_a_workspace_that_is_not_clear_leaves_the_robot_unhomed() -> None:
    setup = RobotOnLoopback(EncodedPlant(ready=False))
    with pytest.raises(NotReadyError, match="nothing has moved"):
        homed(setup, Person(workspace=lambda: False))
    assert not setup.robot.plant.operating_state().is_homed


TWO_LINK = load_robot("two_link")
CRTK = {"robot": "two_link", "dialect": "crtk", "namespace": "/arm1"}


def test_a_robot_that_speaks_crtk_is_homed_by_commands() -> None:
    plant = IdealPlant([0.0, 0.0], joint_names=TWO_LINK.joint_names, ready=False)
    setup = RobotOnLoopback(plant, dialect="crtk")
    person = Person()
    found = homed(setup, person, **CRTK)
    assert found.joint_names == TWO_LINK.joint_names
    assert found.state == ("PAUSED", True, False)
    assert found.external_encoders is None
    assert len(person.asked) == 1  # the workspace; there is no button


def test_a_homing_that_ends_early_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.crtk.client._HOMING_TIMEOUT_S", 1.0)
    setup = RobotOnLoopback(LongHoming(ready=False))
    _, client = robot_over(setup.transport, simulated=True)
    with client, pytest.raises(NotReadyError, match=r"not done after 1 s|not confirmed within") as failure:
        home_client(client, AnswerYes(), patience=1.0)
    assert setup.robot.plant.operating_state() == ("DISABLED", False, False)
    assert "disabled" in failure.value.__notes__[0]


class LateHoming(LongHoming):
    """Takes the press of its button up at a tick."""

    begins = -1

    def wait(self) -> None:
        super().wait()
        self.begins -= 1
        if self.begins == 0:
            self.state_command("enable")
            self.state_command("home")


@pytest.mark.parametrize("ticks", [0, 1, 30, 500])
def test_ctrl_c_disables_a_robot_that_was_asked_and_does_not_show_it_yet(ticks, monkeypatch) -> None:
    plant = LateHoming(ready=False)
    setup = RobotOnLoopback(plant)
    _, client = robot_over(setup.transport, simulated=True)

    def press(_: object) -> None:
        plant.begins = ticks
        if not ticks:
            plant.state_command("enable")
            plant.state_command("home")
        assert not client.operating_state().is_busy  # as it was heard last
        raise KeyboardInterrupt

    monkeypatch.setattr(homing, "press_button", press)
    with client, pytest.raises(KeyboardInterrupt):
        home_client(client, AnswerYes())
    assert plant.begins <= 0
    assert plant.operating_state() == ("DISABLED", False, False)


def test_a_robot_that_homes_already_is_waited_for() -> None:
    plant = LongHoming(ready=False)
    plant.state_command("enable")
    plant.state_command("home")
    setup = RobotOnLoopback(plant)
    person = Person(wait=plant.arrive)
    assert homed(setup, person).state.is_homed
    assert person.asked[1].startswith("wait until the robot is homed")


def test_a_robot_in_fault_is_not_homed_by_commands() -> None:
    plant = IdealPlant([0.0, 0.0], joint_names=TWO_LINK.joint_names)
    plant.state_command("disable")
    robot, client = robot_over(RobotOnLoopback(plant, dialect="crtk").transport, simulated=True, **CRTK)
    fault = OperatingState("FAULT", False, False)
    plant.operating_state = lambda: fault  # type: ignore[method-assign]
    client.wait()
    with client, pytest.raises(NotReadyError, match="in FAULT"):
        home_operated(robot, AnswerYes())
