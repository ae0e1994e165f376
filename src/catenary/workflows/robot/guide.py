"""Guide a person beside a robot step by step, and check each step against what the robot reports."""

from collections.abc import Callable
from typing import Protocol

from catenary.errors import NotReadyError

Check = Callable[[], str | None]  # what is still missing, as the robot reports it, or None
PATIENCE = 60.0  # [s] until the robot must report it; as long as its encoder rig is given to register
LOOK = 0.1  # [s] between two looks at the robot


class Guide(Protocol):
    """Asks a person to do things by hand."""

    def say(self, text: str) -> None:
        """Show a message."""
        ...

    def confirm(self, text: str) -> bool:
        """Ask for something to be done and confirmed; False gives up."""
        ...


class AnswerYes:
    """Confirms everything, for scripts; the robot's reports decide whether it is so."""

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self._say = say

    def say(self, text: str) -> None:
        """Show a message."""
        self._say(text)

    def confirm(self, text: str) -> bool:
        """Confirm."""
        self._say(f"{text} (--yes)")
        return True


def clear_workspace(guide: Guide) -> None:
    """Ask a person to confirm that the robot may move.

    Raises:
        NotReadyError: Given up.
    """
    text = "clear the arm's workspace, and keep the e-stop at hand: it is going to move"
    if not guide.confirm(text):
        raise NotReadyError(f"{text}: given up; nothing has moved")


def have_done(
    guide: Guide, text: str, missing: Check, sleep: Callable[[float], None], *, patience: float = PATIENCE
) -> None:
    """Ask for something to be done unless the robot reports that it is, and wait until it does.

    Args:
        guide: Asks.
        text: What is to be done.
        missing: What the robot reports as missing.
        sleep: Lets time pass.
        patience: [s] after each answer until the robot must report it; then it is asked again.

    Raises:
        NotReadyError: Given up, or with a guide that only says yes not reported in time.
    """
    if missing() is None:
        return
    while True:
        if not guide.confirm(text):
            raise NotReadyError(f"{text}: given up; {missing() or 'though it was done'}")
        waited = 0.0
        while (fault := missing()) is not None and waited < patience:
            sleep(LOOK)
            waited += LOOK
        if fault is None:
            return
        if isinstance(guide, AnswerYes):
            raise NotReadyError(f"{text}: not done after {patience:g} s: {fault}")
        guide.say(f"not yet: {fault}")
