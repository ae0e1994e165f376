"""A board's lines and its plug; what holds for every device on a serial line is in contracts."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.devices.serial_board import SerialBoard
from oracles.simulated_port import SimulatedPort
from patience import until


class Listener(SerialBoard):
    """Keeps what happens, and the times of lines."""

    def __init__(self, port: str) -> None:
        self.events: list[str] = []
        self.times: set[float] = set()
        super().__init__(port, clock=lambda: 4.5, ask=b"?")

    def _take(self, lines: list[str], arrival: float) -> None:
        self.events += lines
        self.times.add(arrival)

    def _on_plug(self, *, is_there: bool) -> None:
        self.events.append("back" if is_there else "gone")


@pytest.fixture
def port(tmp_path: Path) -> Iterator[SimulatedPort]:
    port = SimulatedPort(tmp_path / "port")
    yield port
    port.close()


def test_the_board_is_asked_each_time_it_is_plugged_in_and_half_a_line_is_forgotten(port) -> None:
    with Listener(str(port.link)) as board:
        until(lambda: port.asked() == b"?")
        port.write(b"first\nhalf")
        until(lambda: board.events == ["first"])
        port.unplug()
        until(lambda: board.events == ["first", "gone"])
        until(lambda: not board.is_connected)
        port.plug()
        until(lambda: board.is_connected)
        until(lambda: port.asked() == b"?")
        port.write(b"whole\n")
        until(lambda: board.events == ["first", "gone", "back", "whole"])
        assert board.times == {4.5}


def test_closing_ends_the_thread(port: SimulatedPort) -> None:
    board = Listener(str(port.link))
    board.close()
    assert not board._thread.is_alive()
    assert not board.is_connected
