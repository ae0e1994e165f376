"""A board that speaks the line protocol over a pseudo-terminal, as docs/devices.md has it; it is written from that
page, and shares no code with the driver.

    PYTHONPATH=tests python -m oracles.simulated_board /tmp/board

makes a link to a terminal and speaks until Ctrl-C.
"""

import contextlib
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from oracles.simulated_port import SimulatedPort

UP = (0.0, 0.0, 9.81)


def framed(body: str) -> bytes:
    value = 0
    for byte in body.encode():
        value = value ^ byte
    return f"${body}*{value:02X}\r\n".encode()


class SimulatedBoard(SimulatedPort):
    """`link` leads to its terminal. A test writes lines itself, or lets it speak at a rate by a thread."""

    def __init__(self, link: Path, *, unit: str = "m/s2", gyroscope: bool = True, start_us: int = 0) -> None:
        super().__init__(link)
        self.unit, self.gyroscope = unit, gyroscope
        self.count, self.micros = 0, start_us
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def hello(self) -> None:
        rates = "rad/s,4.36" if self.gyroscope else "none,0"
        end = {"m/s2": 19.6133, "g": 2.0}[self.unit]
        self.write(framed(f"CATHI,1,simulated,{self.unit},{end},{rates},100"))

    def line(self, force: tuple[float, float, float] = UP, rate: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> bytes:
        """The next sample's line; the board's clock and count go on."""
        numbers = [*force, *(rate if self.gyroscope else ())]
        body = f"CATAC,{self.count % 65536},{self.micros % 4294967296}," + ",".join(f"{v:.5f}" for v in numbers)
        self.count += 1
        self.micros += 10000
        return framed(body)

    def speak(self, force: Callable[[float], tuple[float, float, float]] = lambda t: UP) -> None:
        """Send samples at 100 Hz, and a hello every second and when asked, until `close`."""

        def run() -> None:
            begin, k = time.monotonic(), 0
            while not self._ending.is_set():
                if self._ends is not None:
                    if k % 100 == 0 or b"?" in self.asked():
                        self.hello()
                    self.write(self.line(force(k / 100.0)))
                k += 1
                self._ending.wait(max(0.0, begin + k / 100.0 - time.monotonic()))

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
        super().close()


if __name__ == "__main__":
    board = SimulatedBoard(Path(sys.argv[1]))
    board.speak()
    with contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()
    board.close()
