"""Exit codes of the catenary command: 0 done, 1 a fault was found, 2 refused, 128 and more ended by a signal.

SIGTERM and SIGHUP end a command as Ctrl-C does: a robot holds and is paused. None of them is lost: Python ignores what
is raised while a library's C code calls back, as LLVM does of each function that it has compiled, and in `__del__`.
What interrupted there interrupts again.
"""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from catenary.operating_system import ENDING_SIGNALS, interrupt

FAULT_FOUND = 1  # the command did what was asked, and what it looked at is not as it should be
REFUSED = 2  # nothing was done: an option, a file or a robot is not what the command needs


def code_of_signal(name: str) -> int:
    """Return the exit code of a command that a signal of this name ended, 128 and its number; 130 for Ctrl-C."""
    return 128 + signal.Signals.__members__.get(name, signal.SIGINT)


_INTERRUPT_AGAIN_AFTER_S = 0.05  # until what was lost interrupts again
_SAME_SIGNAL_S = 5.0  # in which a second signal is taken for the first: services and terminals send several


class EndedBySignal(KeyboardInterrupt):
    """A signal asked for the end; its text is the signal's name."""


@contextmanager
def signals_interrupt() -> Iterator[None]:
    """Let SIGTERM and SIGHUP interrupt what runs inside, and lose no Ctrl-C; outside the main thread nothing changes.

    A signal that is ignored, as SIGHUP below `nohup`, stays ignored. Further signals do not interrupt the cleaning up.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked, name = -_SAME_SIGNAL_S, ""

    def end(number: int, _: FrameType | None) -> None:
        nonlocal asked, name
        now = time.monotonic()
        if now - asked >= _SAME_SIGNAL_S:
            asked, name = now, signal.Signals(number).name
            raise EndedBySignal(name)

    tell = sys.unraisablehook

    def unraisable(lost: "sys.UnraisableHookArgs") -> None:
        nonlocal asked
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            tell(lost)
            return
        asked = -_SAME_SIGNAL_S
        number = signal.Signals[str(lost.exc_value)] if lost.exc_type is EndedBySignal else signal.SIGINT
        again = threading.Timer(_INTERRUPT_AGAIN_AFTER_S, interrupt, (number,))
        again.daemon = True
        again.start()

    sys.unraisablehook = unraisable
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    taken = {number: handler for number, handler in before.items() if handler not in (signal.SIG_IGN, None)}
    for number in taken:
        signal.signal(number, end)
    try:
        yield
    except OSError as error:
        if name:  # SIGHUP says that the terminal is gone: what is printed afterwards fails
            raise EndedBySignal(name) from error
        raise
    finally:
        sys.unraisablehook = tell
        for number, handler in taken.items():
            signal.signal(number, handler)
