"""What a program that shows itself asks of a page."""

from typing import Protocol

from catenary.view.controls import Change
from catenary.view.state import ViewState


class StatePage(Protocol):
    """Where states go and changes come from; neither waits."""

    @property
    def is_running(self) -> bool: ...  # noqa: D102

    def put(self, state: ViewState) -> None:
        """Show a state in place of the last one."""
        ...

    def changes(self) -> list[Change]:
        """Return what was changed on the page since the last call."""
        ...
