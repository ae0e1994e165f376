"""Changes of operating state, and who may ask for them, in both dialects.

`crtk`: enable DISABLED, FAULT -> ENABLED; disable any -> DISABLED; pause ENABLED -> PAUSED; resume PAUSED -> ENABLED;
home and unhome touch is_homed only. [collaborative-robotics.github.io, robot operating state]

`raven`: the robot's run levels in CRTK's words. Emergency stop is DISABLED; the silver button leaves it, and nothing
else does: init is ENABLED and busy while the arm homes; then the pedal is up, PAUSED. `resume` stands for the pedal
pressed, ENABLED; `pause` for the pedal released; `disable` for the emergency stop. `enable` is ignored.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, cast

from catenary.crtk.dialects import dialect_named
from catenary.crtk.exclusive_control import STOPPING_COMMANDS
from catenary.errors import NotReadyError
from catenary.plant import STATE_COMMANDS, TRANSITIONS, OperatingState, Plant, StateCommand, StateName

_Transitions = Mapping[StateCommand, Mapping[StateName, StateName]]
_RAVEN: _Transitions = {**TRANSITIONS, "enable": {}, "home": {"ENABLED": "ENABLED", "PAUSED": "ENABLED"}}
# state that a command asks for: it is no mistake to ask for the one that there is
_ASKED_FOR: dict[str, StateName] = {"enable": "ENABLED", "disable": "DISABLED", "pause": "PAUSED"}
_LEAST: tuple[StateName, ...] = ("DISABLED", "PAUSED", "ENABLED")
RunLevel = Literal[0, 1, 2, 3]  # emergency stop, init, pedal up, pedal down


def why_not_obeyed(state: OperatingState) -> str:
    """What to say of a motion command to an arm in a state in which none moves it."""
    homed = "homed" if state.is_homed else "not homed"
    return f"not obeyed while the arm is {state.state}, {homed}{' and busy' if state.is_busy else ''}"


def robot_state(arms: Sequence[OperatingState]) -> OperatingState:
    """Return the state of a robot that has one for all arms: FAULT before all, then what is busy, then the least."""
    names = [arm.state for arm in arms] or ["DISABLED"]
    is_busy, is_homed = any(arm.is_busy for arm in arms), bool(arms) and all(arm.is_homed for arm in arms)
    if "FAULT" in names:
        return OperatingState("FAULT", is_homed, False)
    if is_busy:
        return OperatingState("ENABLED", is_homed, True)
    least: StateName = next(name for name in _LEAST if name in names)
    return OperatingState(least, is_homed, False)


class StateMachine:
    """Decides about one arm's state commands."""

    def __init__(self, plant: Plant, dialect: str) -> None:
        self._plant = plant
        self._pauses = dialect_named(dialect).has_run_levels
        self._table = _RAVEN if self._pauses else TRANSITIONS
        self._homing = False
        self.held_by = ""  # why nothing but what stops the arm is obeyed
        self.can_change = "state_command" in plant.supports

    def command(self, text: str) -> str | None:
        """Obey a state command; where it is ignored, say why."""
        name = cast(StateCommand, text.strip())
        if name not in STATE_COMMANDS:
            return f'"{name}": ignored, expected one of {", ".join(STATE_COMMANDS)}'
        if not self.can_change:
            return f"{name}: ignored, the arm is parked"
        if self.held_by and name not in STOPPING_COMMANDS:
            return f"{name}: ignored, {self.held_by}"
        state = self._plant.operating_state()
        if _ASKED_FOR.get(name) == state.state:
            return None
        if state.state not in self._table[name]:
            starts = self._pauses and name in ("enable", "home")
            hint = "; the silver button starts the robot" if starts else ""
            return f"{name}: ignored while {state.state}{hint}"
        if name == "resume" and not state.is_homed:
            return "resume: ignored, the arm is not homed"
        if name == "home":
            return None if state.is_homed or state.is_busy else self._home(state)
        return self._ask(name)

    def press_button(self) -> str | None:
        """Press the RAVEN-II's silver button: leave the emergency stop, home what is not homed; say why where not."""
        state = self._plant.operating_state()
        if not self.can_change:
            return "the arm is parked"
        if self.held_by:
            return self.held_by
        if state.state not in ("DISABLED", "FAULT"):
            return f"the arm is {state.state} already"
        if not state.is_homed:
            return self._home(state)
        return self._ask("enable") or self._ask("pause")

    def update(self) -> None:
        """Look whether homing has ended; called once a tick."""
        if not self._homing:
            return
        state = self._plant.operating_state()
        if not state.is_busy:
            self._homing = False
            if self._pauses and state.state == "ENABLED":
                self._ask("pause")

    def run_level(self, state: OperatingState) -> RunLevel:
        """Run level of a RAVEN-II in a state."""
        if state.state in ("DISABLED", "FAULT"):
            return 0
        if state.state == "PAUSED":
            return 2
        return 1 if state.is_busy or not state.is_homed else 3

    def _home(self, state: OperatingState) -> str | None:
        first: Mapping[StateName, StateCommand] = {"DISABLED": "enable", "FAULT": "enable", "PAUSED": "resume"}
        refused = self._ask(first[state.state]) if state.state in first else None
        refused = refused or self._ask("home")
        self._homing = refused is None
        return refused

    def _ask(self, command: StateCommand) -> str | None:
        try:
            self._plant.state_command(command)
        except NotReadyError as error:
            return str(error)
        return None
