"""The other end of a serial line, over a pseudo-terminal: what boards in tests are plugged in with."""

import contextlib
import os
import tty
from pathlib import Path


class SimulatedPort:
    """`link` leads to its terminal, as a name below /dev/serial/by-id would."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self._ends: tuple[int, int] | None = None
        self.plug()

    def plug(self) -> None:
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        self._ends = ours, theirs
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(theirs))

    def unplug(self) -> None:
        self.link.unlink(missing_ok=True)
        for end in self._ends or ():
            os.close(end)
        self._ends = None

    def write(self, data: bytes) -> None:
        if self._ends is not None:
            with contextlib.suppress(BlockingIOError):  # nobody reads: a board's bytes are lost, too
                os.write(self._ends[0], data)

    def asked(self) -> bytes:
        """What the host has sent."""
        try:
            return os.read(self._ends[0], 1000) if self._ends else b""
        except BlockingIOError:
            return b""

    def close(self) -> None:
        self.unplug()
