"""Base class of boards on a serial port: a reading thread, line splitting, reconnection after unplugging."""

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Self

import serial
import serial.tools.list_ports

from catenary.errors import SensorError
from catenary.operating_system import require_linux

BAUD = 115200
_RETRY_EVERY_S = 0.25  # [s] between attempts to reopen the port
_LINE_BYTES = 200  # longest line; more is noise
_log = logging.getLogger(__name__)


class LineSplitter:
    """Split a stream of bytes into lines; noise without line ends is discarded."""

    def __init__(self) -> None:
        self._partial = b""

    def feed(self, data: bytes) -> list[str]:
        """Add bytes, and return the completed lines without their ends."""
        *lines, self._partial = (self._partial + data).split(b"\n")
        if len(self._partial) > _LINE_BYTES:
            lines.append(self._partial)  # refused and counted by the parser
            self._partial = b""
        # characters other than ASCII fail the checksum
        return [line.strip(b"\r").decode("ascii", errors="replace") for line in lines if line.strip()]


class SerialBoard(ABC):
    """Board on a serial port, read by a thread, which delivers lines that arrive together in one call.

    After unplugging the thread waits for the port to reappear under the same name. Use as a context manager.
    """

    def __init__(self, port: str, *, clock: Callable[[], float], ask: bytes = b"") -> None:
        """Open the port and start reading; subclasses call this when they are ready for lines.

        `clock` [s] stamps the lines; `ask` is sent whenever the port is opened.
        """
        require_linux("a board on a serial port")
        self.port, self._clock, self._ask = port, clock, ask
        self._ending = threading.Event()
        try:
            self._line: serial.Serial | None = self._open()
        except (serial.SerialException, OSError, ValueError) as error:
            ports = ", ".join(sorted(p.device for p in serial.tools.list_ports.comports())) or "none"
            raise SensorError(f"{port}: cannot be opened: {error}; serial ports here: {ports}") from error
        self._thread = threading.Thread(target=self._run, name=f"catenary {port}", daemon=True)
        self._thread.start()

    @abstractmethod
    def _take(self, lines: list[str], arrival: float) -> None:
        """Process lines without their ends that arrived at a time [s]; called in the reading thread."""

    @abstractmethod
    def _on_plug(self, *, is_there: bool) -> None:
        """Handle unplugging, and replugging before its first line; called in the reading thread."""

    @property
    def is_connected(self) -> bool:
        """The port is open."""
        return self._line is not None

    def close(self) -> None:
        """Stop reading and close the port."""
        self._ending.set()
        self._thread.join(timeout=2.0)
        self._drop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open(self) -> serial.Serial:
        line = serial.Serial(self.port, BAUD, timeout=0.05, write_timeout=0.2)
        if self._ask:
            line.write(self._ask)
        return line

    def _drop(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            with suppress(OSError):
                line.close()

    def _run(self) -> None:
        splitter = LineSplitter()
        while not self._ending.is_set():
            if self._line is None:
                self._ending.wait(_RETRY_EVERY_S)
                try:
                    line = self._open()
                except (serial.SerialException, OSError, ValueError):
                    continue  # not there yet
                splitter = LineSplitter()
                self._on_plug(is_there=True)
                self._line = line
                continue
            try:
                data = self._line.read(max(1, self._line.in_waiting))
            except (serial.SerialException, OSError, TypeError):  # pyserial may fail during its own close
                _log.warning("%s: the board is gone; waiting for it", self.port)
                self._on_plug(is_there=False)
                self._drop()
                continue
            if data:
                arrival = self._clock()
                lines = splitter.feed(data)
                if lines:
                    self._take(lines, arrival)
