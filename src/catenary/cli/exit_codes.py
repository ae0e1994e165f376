"""Exit codes of the catenary command: 0 done, 1 a fault was found, 2 refused, 128 and more ended by a signal."""

import signal

FAULT_FOUND = 1  # the command did what was asked, and what it looked at is not as it should be
REFUSED = 2  # nothing was done: an option, a file or a robot is not what the command needs


def code_of_signal(name: str) -> int:
    """Return the exit code of a command that a signal of this name ended, 128 and its number; 130 for Ctrl-C."""
    return 128 + signal.Signals.__members__.get(name, signal.SIGINT)
