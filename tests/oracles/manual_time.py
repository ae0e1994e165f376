"""Stand-ins for the module `time` where a program paces itself: time passes only while it sleeps.

So how often a loop ran, and what it had heard by then, do not depend on what else the machine does.
"""

from collections.abc import Callable
from typing import Any

import pytest

from catenary.devices.accelerometer import SerialAccelerometer
from catenary.devices.encoder_board import EncoderBoard
from catenary.devices.serial_board import SerialBoard
from catenary.topics import SECOND
from oracles.simulated_port import SimulatedPort
from oracles.ticking_clock import TickingClock
from patience import until

START = 1_700_000_000 * SECOND  # [ns]


class ManualTime(TickingClock):
    """What programs use of `time`, and of a transport's clock."""

    def __init__(self) -> None:
        super().__init__(0.01, START)

    def monotonic(self) -> float:
        return self.now() / SECOND

    perf_counter = monotonic

    def process_time(self) -> float:
        return 0.0


class BoardTime(ManualTime):
    """While somebody sleeps, a board sends a line every 10 ms, and its driver has taken it in before time goes on.

    It does so for every board that is opened meanwhile in this process; `greet` is what one says when its port is opened.
    """

    def __init__(
        self, board: SimulatedPort, line: Callable[[], bytes], greet: Callable[[], Any] = lambda: None
    ) -> None:
        super().__init__()
        self._board, self._line, self._greet = board, line, greet
        self._heard = 0  # lines

    def tick(self) -> None:
        heard = self._heard
        self._board.write(self._line())
        until(lambda: self._heard > heard, every=0.0002)

    def rule(self, patch: pytest.MonkeyPatch, *modules: str) -> None:
        """Take the place of `time` in modules, and of the clock of devices."""
        for module in modules:
            patch.setattr(f"{module}.time", self)
        for device in (SerialAccelerometer, EncoderBoard):
            patch.setitem(device.__init__.__kwdefaults__, "clock", self.monotonic)
            patch.setattr(device, "_take", self._counted(device._take))
        begin = SerialBoard.__init__

        def greeted(board: SerialBoard, *arguments: Any, **options: Any) -> None:
            begin(board, *arguments, **options)
            self._greet()

        patch.setattr(SerialBoard, "__init__", greeted)

    def _counted(self, take: Callable[..., None]) -> Callable[..., None]:
        def taken(board: SerialBoard, lines: list[str], arrival: float) -> None:
            take(board, lines, arrival)
            self._heard += len(lines)

        return taken
