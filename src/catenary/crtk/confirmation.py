"""How a robot confirms state commands, and within which time."""

from collections.abc import Callable, Mapping

from catenary.plant import OperatingState, StateCommand

COMMAND_TIMEOUT = 2.0  # [s] until a transition must have been confirmed
HOMING_TIMEOUT = 180.0  # [s]; RAVEN-II's external encoders alone are given 60 s
SETTLE = 0.05  # [s] in which a robot takes up `home`: before, its state is still the one from before
CONFIRMED: Mapping[StateCommand, Callable[[OperatingState], bool]] = {
    "enable": lambda now: now.state == "ENABLED",
    "disable": lambda now: now.state == "DISABLED",
    "pause": lambda now: now.state != "ENABLED",  # one that is not enabled is not under way either
    "resume": lambda now: now.state == "ENABLED",
    "home": lambda now: now.is_homed and not now.is_busy,
    "unhome": lambda now: not now.is_homed,
}


def patience_of(command: StateCommand) -> float:
    """Time [s] that a robot is given to confirm a command."""
    return HOMING_TIMEOUT if command == "home" else COMMAND_TIMEOUT
