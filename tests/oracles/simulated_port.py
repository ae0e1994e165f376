"""The other end of a serial line, over a pseudo-terminal: what boards in tests are plugged in with."""

import contextlib
import os
import threading
import tty
from pathlib import Path


class SimulatedPort:
    """`link` leads to its terminal, as a name below /dev/serial/by-id would."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self._lock = threading.RLock()  # a board may speak in a thread while a test pulls its plug
        self._ends: tuple[int, int] | None = None
        self.plug()

    def plug(self) -> None:
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        with self._lock:
            self._ends = ours, theirs
            self.link.unlink(missing_ok=True)
            self.link.symlink_to(os.ttyname(theirs))

    def unplug(self) -> None:
        with self._lock:
            self.link.unlink(missing_ok=True)
            for end in self._ends or ():
                os.close(end)
            self._ends = None

    def write(self, data: bytes) -> None:
        with self._lock, contextlib.suppress(BlockingIOError):  # nobody reads: a board's bytes are lost, too
            if self._ends is not None:
                os.write(self._ends[0], data)

    def asked(self) -> bytes:
        """What the host has sent."""
        with self._lock, contextlib.suppress(BlockingIOError):
            return os.read(self._ends[0], 1000) if self._ends else b""
        return b""

    def close(self) -> None:
        self.unplug()
