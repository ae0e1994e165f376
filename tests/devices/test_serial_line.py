from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.devices.serial_line import SerialLine
from catenary.errors import SensorError
from oracles.simulated_port import SimulatedPort
from patience import until


@pytest.fixture
def port(tmp_path: Path) -> Iterator[SimulatedPort]:
    port = SimulatedPort(tmp_path / "port")
    yield port
    port.close()


def test_lines_come_whole_with_the_time_at_which_they_came(port):
    heard = []
    line = SerialLine(str(port.link), lambda lines, time: heard.append((lines, time)), clock=lambda: 4.5)
    line.start()
    port.write(b"one\r\ntwo\r\nthr")
    until(lambda: heard)
    port.write(b"ee\n")
    until(lambda: [text for lines, _ in heard for text in lines] == ["one", "two", "three"])
    assert {moment for _, moment in heard} == {4.5}
    line.close()


def test_the_board_is_asked_each_time_it_is_plugged_in(port):
    events = []
    line = SerialLine(
        str(port.link),
        lambda lines, time: events.extend(lines),
        ask=b"?",
        on_gone=lambda: events.append("gone"),
        on_back=lambda: events.append("back"),
    )
    line.start()
    until(lambda: port.asked() == b"?")
    port.unplug()
    until(lambda: events == ["gone"])
    assert not line.is_connected
    port.plug()
    until(lambda: line.is_connected)
    until(lambda: port.asked() == b"?")
    port.write(b"hello\n")
    until(lambda: events == ["gone", "back", "hello"])
    line.close()


def test_half_a_line_from_before_the_plug_was_pulled_is_forgotten(port):
    heard = []
    line = SerialLine(str(port.link), lambda lines, time: heard.extend(lines))
    line.start()
    port.write(b"first\nhalf")
    until(lambda: heard == ["first"])
    port.unplug()
    until(lambda: not line.is_connected)
    port.plug()
    until(lambda: line.is_connected)
    port.write(b"whole\n")
    until(lambda: heard == ["first", "whole"])
    line.close()


def test_closing_ends_the_thread_and_needs_no_start(port):
    line = SerialLine(str(port.link), lambda lines, time: None)
    line.close()
    line = SerialLine(str(port.link), lambda lines, time: None)
    line.start()
    assert line.is_reading
    line.close()
    until(lambda: not line.is_reading)
    assert not line.is_connected


def test_a_port_that_is_not_there_is_told_with_those_that_are(tmp_path):
    with pytest.raises(SensorError, match=r"none: cannot be opened: .*; serial ports here: "):
        SerialLine(str(tmp_path / "none"), lambda lines, time: None)
