"""Lines of text from a serial port, read by a thread of their own; a port that goes away is waited for."""

import logging
import threading
import time
from collections.abc import Callable

import serial
import serial.tools.list_ports

from catenary.devices.line_protocol import LineSplitter
from catenary.errors import SensorError

BAUD = 115200
RETRY = 0.25  # [s] between attempts to find a board that was unplugged
_log = logging.getLogger(__name__)
TakeLines = Callable[[list[str], float], None]


def _nothing() -> None:
    pass


class SerialLine:
    """Hands over lines as they come, those of one read together, with the time [s] at which they came.

    A board that is unplugged is waited for, and goes on where it is plugged in again under the same name.
    """

    def __init__(
        self,
        port: str,
        take: TakeLines,
        *,
        baud: int = BAUD,
        clock: Callable[[], float] = time.monotonic,
        ask: bytes = b"",
        on_gone: Callable[[], None] = _nothing,
        on_back: Callable[[], None] = _nothing,
    ) -> None:
        """Open the port; `start` begins to read.

        Args:
            port: As /dev/ttyACM0.
            take: Gets lines without their ends, and their time on `clock`; called by the reading thread, as are
                the next.
            baud: Speed of the line.
            clock: Of the times [s].
            ask: Sent whenever the port is opened.
            on_gone: Called when the board is unplugged.
            on_back: Called when it is there again, before its first line.

        Raises:
            SensorError: The port cannot be opened; the message lists those that there are.
        """
        self.port, self.baud = port, baud
        self._take, self._clock, self._ask = take, clock, ask
        self._on_gone, self._on_back = on_gone, on_back
        self._ending = threading.Event()
        try:
            self._line: serial.Serial | None = self._open()
        except (serial.SerialException, OSError, ValueError) as error:
            ports = ", ".join(sorted(p.device for p in serial.tools.list_ports.comports())) or "none"
            raise SensorError(f"{port}: cannot be opened: {error}; serial ports here: {ports}") from error
        self._thread = threading.Thread(target=self._run, name=f"catenary {port}", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    @property
    def is_connected(self) -> bool:
        """The port is open; lines may come."""
        return self._line is not None

    @property
    def is_reading(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    def close(self) -> None:
        """Stop reading and close the port."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._drop()

    def _open(self) -> serial.Serial:
        line = serial.Serial(self.port, self.baud, timeout=0.05, write_timeout=0.2)
        if self._ask:
            line.write(self._ask)
        return line

    def _drop(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            try:
                line.close()
            except OSError as error:
                _log.debug("%s: closing: %s", self.port, error)

    def _run(self) -> None:
        splitter = LineSplitter()
        while not self._ending.is_set():
            if self._line is None:
                self._ending.wait(RETRY)
                try:
                    line = self._open()
                except (serial.SerialException, OSError, ValueError):
                    continue  # not there yet
                splitter = LineSplitter()
                self._on_back()
                self._line = line
                continue
            try:
                data = self._line.read(max(1, self._line.in_waiting))
            except (serial.SerialException, OSError, TypeError):  # pyserial may trip over its own close
                _log.warning("%s: the board is gone; waiting for it", self.port)
                self._on_gone()
                self._drop()
                continue
            if data:
                arrival = self._clock()
                lines = splitter.feed(data)
                if lines:
                    self._take(lines, arrival)
