"""State commands in both dialects, against the tables of transitions that they were specified by."""

import numpy as np
import pytest

from catenary.crtk.serving.state_machine import StateMachine
from catenary.plant import OperatingState, StateName
from oracles.ideal_plant import IdealPlant

# [collaborative-robotics.github.io, robot operating state]: what changes a homed robot's state; nothing else does
CRTK = {
    ("DISABLED", "enable"): "ENABLED",
    ("FAULT", "enable"): "ENABLED",
    ("ENABLED", "disable"): "DISABLED",
    ("PAUSED", "disable"): "DISABLED",
    ("FAULT", "disable"): "DISABLED",
    ("ENABLED", "pause"): "PAUSED",
    ("PAUSED", "resume"): "ENABLED",
}
CHANGES = {"crtk": CRTK, "raven": {key: after for key, after in CRTK.items() if key[1] != "enable"}}
# CRTK's table has these without "(invalid)", and its Python client enables what is enabled
NO_MISTAKE = [("ENABLED", "enable"), ("DISABLED", "disable"), ("PAUSED", "pause")]
HARMLESS = ["home", "unhome"]  # of is_homed, not of the state


def machine(dialect: str, state: StateName, *, homed: bool = True) -> tuple[StateMachine, IdealPlant]:
    plant = IdealPlant(np.zeros(3).tolist(), supports=frozenset({"state_command"}))
    plant.state = OperatingState(state, homed, False)
    return StateMachine(plant, dialect), plant


@pytest.mark.parametrize("dialect", ["crtk", "raven"])
@pytest.mark.parametrize("state", ["DISABLED", "ENABLED", "PAUSED", "FAULT"])
@pytest.mark.parametrize("command", ["enable", "disable", "pause", "resume", "home", "unhome", "dance", "NULL"])
def test_a_command_changes_the_state_as_specified_or_is_refused(dialect, state, command) -> None:
    states, plant = machine(dialect, state)
    refused = states.command(f" {command}\n")
    assert plant.operating_state().state == CHANGES[dialect].get((state, command), state)
    if (state, command) in CHANGES[dialect] or (state, command) in NO_MISTAKE:
        assert refused is None
    elif command not in HARMLESS:
        assert refused is not None
        assert command in refused
        assert f"ignored while {state}" in refused or "expected one of enable" in refused


@pytest.mark.parametrize("dialect", ["crtk", "raven"])
@pytest.mark.parametrize("state", ["DISABLED", "ENABLED", "PAUSED", "FAULT"])
def test_unhome_touches_only_that(dialect: str, state: StateName) -> None:
    states, plant = machine(dialect, state)
    assert states.command("unhome") is None
    assert plant.operating_state() == (state, False, False)


def test_resume_wants_a_homed_arm_and_a_homed_arm_is_not_homed_again() -> None:
    states, plant = machine("crtk", "PAUSED", homed=False)
    assert states.command("resume") == "resume: ignored, the arm is not homed"
    states, plant = machine("crtk", "ENABLED")
    assert states.command("home") is None
    assert plant.operating_state() == ("ENABLED", True, False)
