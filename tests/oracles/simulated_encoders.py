"""An encoder board over a pseudo-terminal: counts as `a_b_c` lines, from counters of so many bits."""

from collections.abc import Sequence
from pathlib import Path

from oracles.simulated_port import SimulatedPort


class SimulatedEncoders(SimulatedPort):
    """Writes what a test tells it; `offset` is where its counters stand when the joints are at 0."""

    def __init__(self, link: Path, *, bits: int = 32, offset: Sequence[int] = (0, 0, 0)) -> None:
        super().__init__(link)
        self.bits, self.offset = bits, tuple(offset)

    def line(self, counts: Sequence[float]) -> bytes:
        words = []
        for value, shift in zip(counts, self.offset, strict=True):
            cut = (int(value) + shift) % 2**self.bits  # what a counter of so many bits holds
            words.append(str(cut - 2**self.bits if cut >= 2 ** (self.bits - 1) else cut))
        return ("_".join(words) + "\r\n").encode()

    def send(self, counts: Sequence[float]) -> None:
        self.write(self.line(counts))
