"""The encoders' board on a bench with its driver, in a time that goes on by a period with each line."""

from pathlib import Path
from typing import Any

import numpy as np

from catenary.devices.encoder_board import EncoderBoard
from oracles.simulated_encoders import SimulatedEncoders
from patience import until

AWAY, STOPS = np.array([3000.0, 26_000.0, 100_000.0]), np.array([0.0, 30_000.0, 112_000.0])


class EncoderBench:
    def __init__(self, link: Path) -> None:
        self.board = SimulatedEncoders(link)
        self.now, self.period = 10.0, 0.01
        self.driver = EncoderBoard(str(link), clock=lambda: self.now)
        self.board.write(b"7_8\r\n")  # the port is opened in the middle of a line
        until(lambda: self.heard == 1)

    @property
    def heard(self) -> int:
        t = self.driver.tally
        return t.rows + t.malformed + t.cut + t.rejected

    def write(self, data: bytes) -> None:
        self.now += self.period
        before = self.heard
        self.board.write(data)
        until(lambda: self.heard > before, every=0.0005)

    def send(self, *rows: Any) -> None:
        for row in rows:
            self.write(self.board.line(row))

    def tell(self, *, is_busy: bool, is_homed: bool) -> None:
        self.driver.set_robot_state(is_busy=is_busy, is_homed=is_homed)

    def home(self) -> None:
        """Into the stops, and back."""
        self.tell(is_busy=True, is_homed=False)
        for share in (*np.linspace(0.0, 1.0, 60), *[1.0] * 5, *np.linspace(1.0, 0.0, 60)):
            self.send(np.round(AWAY + share * (STOPS - AWAY)))
        self.tell(is_busy=False, is_homed=True)

    def close(self) -> None:
        self.driver.close()
        self.board.close()
