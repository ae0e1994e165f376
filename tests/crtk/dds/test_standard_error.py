import os
import subprocess
import sys
import threading

import pytest

from dds import Network

# a program of DDS that gets packets which begin as DDS's do, and are none
GARBAGE = """
import os, socket, sys, time
from catenary.crtk.dds.transport import DdsTransport
domain, count = int(os.environ["ROS_DOMAIN_ID"]), int(sys.argv[1])
with DdsTransport("robot", settle=0.05), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
    for k in range(count):
        packet = b"RTPS\\2\\1\\1\\x10" + bytes(12) + b"\\6\\1\\x18\\0" + bytes([k % 256]) * 24
        for port in (10, 11):
            sender.sendto(packet, ("127.0.0.1", 7400 + 250 * domain + port))
        time.sleep(0.001)
    time.sleep(0.3)
"""
MALFORMED = "malformed packet received"


def said(count: int, more: str = "") -> list[str]:
    """Lines on standard error of a program that got so much garbage."""
    variables = Network().environment
    variables["CYCLONEDDS_URI"] += more
    done = subprocess.run(
        [sys.executable, "-c", GARBAGE, str(count)],
        env=variables,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stderr.splitlines()


def test_cyclones_lines_about_malformed_packets_are_thinned() -> None:
    lines = [line for line in said(200) if MALFORMED in line]
    assert 1 <= len(lines) <= 1 + 60 / 5  # once, then each 5 s, on a machine that is a minute late


def test_whoever_traces_gets_all_of_them() -> None:
    trace = ",<Tracing><Category>warning</Category><OutputFile>stderr</OutputFile></Tracing>"
    assert sum(MALFORMED in line for line in said(50, trace)) >= 50


def test_what_else_cyclone_says_is_passed_on() -> None:
    lines = said(20, ",<General><NetworkInterfaceAddress>auto</NetworkInterfaceAddress></General>")
    assert any("NetworkInterfaceAddress" in line for line in lines), lines


def test_lines_are_passed_on_as_they_came_and_malformed_packets_counted(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: pip install cyclonedds")
    from catenary.crtk.dds import standard_error

    times = iter([10.0, 11.0, 12.0, 15.5, 15.6])
    monkeypatch.setattr(standard_error.time, "monotonic", lambda: next(times))
    reading, writing = os.pipe()
    thread = threading.Thread(target=standard_error._pass_on, args=(reading,))
    lines = [f"{k} [0] recv: {MALFORMED} {k}" for k in range(5)]
    others = [f"{k} [0] tev: another warning" for k in range(5)]
    with open(writing, "wb") as stream:
        for line, other in zip(lines, others, strict=True):
            stream.write(f"{line}\n{other}\n".encode())
    thread.start()
    thread.join()
    found = capfd.readouterr().err.splitlines()
    assert [line for line in found if MALFORMED not in line] == others
    assert [line for line in found if MALFORMED in line] == [lines[0], f"{lines[3]} (4 times so far)"]
