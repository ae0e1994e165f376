import os
import subprocess
import sys
import threading
from xml.etree import ElementTree

import pytest

from catenary.errors import InputError
from dds import VARIABLES, Network, environment, free_domain, require_dds


@pytest.fixture(autouse=True)
def _plain(monkeypatch: pytest.MonkeyPatch) -> None:
    require_dds()
    for name in (*VARIABLES, "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("text", ["233", "-1", "1.5", "one", "٣"])
def test_a_domain_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    from catenary.crtk.dds.domain import enter_domain

    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match=r"ROS_DOMAIN_ID .*: expected a whole number from 0 to 232"):
        enter_domain()


def test_the_domain_is_0_where_none_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from catenary.crtk.dds.domain import domain_number

    assert domain_number() == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", " 42 ")
    assert domain_number() == 42


@pytest.mark.parametrize(
    ("name", "value"),
    [("ROS_AUTOMATIC_DISCOVERY_RANGE", "PLANET"), ("ROS_STATIC_PEERS", "10.0.0.1;<Peer/>")],
)
def test_a_variable_that_has_no_such_value_is_refused(monkeypatch, name: str, value: str) -> None:
    from catenary.crtk.dds.domain import enter_domain

    monkeypatch.setenv(name, value)
    with pytest.raises(InputError, match=name):
        enter_domain()


FIND = """
import sys, time
from catenary.crtk.dds.transport import DdsTransport
with DdsTransport(sys.argv[1], settle=0.2) as transport:
    transport.publisher(f"/{sys.argv[1]}", "std_msgs/String")
    end = time.monotonic() + float(sys.argv[3])
    while time.monotonic() < end and f"/{sys.argv[2]}" not in transport.topics():
        time.sleep(0.05)
    print(f"/{sys.argv[2]}" in transport.topics(), flush=True)
    time.sleep(2.0)
"""


def _find(domain: int, seconds: float, first: dict[str, str], second: dict[str, str]) -> list[str]:
    """Whether two programs find each other, in the environments given, without settings of Cyclone's."""
    variables = environment(domain)
    del variables["CYCLONEDDS_URI"]
    programs = [
        subprocess.Popen(
            [sys.executable, "-c", FIND, *names, str(seconds)],
            env={**variables, **changed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for names, changed in ((("one", "other"), first), (("other", "one"), second))
    ]
    return [program.communicate(timeout=120.0)[0].strip() for program in programs]


@pytest.mark.slow
@pytest.mark.parametrize(
    "local", [{"ROS_LOCALHOST_ONLY": "1"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}]
)
def test_programs_that_keep_to_the_machine_find_each_other(local: dict[str, str]) -> None:
    assert _find(free_domain(), 40.0, local, local) == ["True", "True"]


@pytest.mark.slow
def test_a_program_that_is_off_is_found_by_nobody() -> None:
    local = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    off = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    assert _find(free_domain(), 4.0, local, off) == ["False", "False"]


def test_settings_of_cyclone_that_are_none_are_refused_by_name(tmp_path) -> None:
    code = "from catenary.crtk.dds.domain import enter_domain; enter_domain()"
    variables = {**environment(free_domain()), "CYCLONEDDS_URI": "<CycloneDDS><Nonsense/></CycloneDDS>"}
    ended = subprocess.run(
        [sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=False
    )
    assert "TransportError" in ended.stderr
    assert "CYCLONEDDS_URI" in ended.stderr


@pytest.mark.parametrize("wide", ["SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT"])
@pytest.mark.parametrize("own", ["", "<CycloneDDS><Domain><Id>any</Id></Domain></CycloneDDS>"])
def test_types_of_fast_dds_are_not_compared_whatever_else_is_set(monkeypatch, wide: str, own: str) -> None:
    from catenary.crtk.dds import domain

    given: list[str] = []
    monkeypatch.setattr(domain, "Domain", lambda number, settings: given.append(settings))
    monkeypatch.setattr(domain, "_domains", {})
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", wide)
    monkeypatch.setenv("CYCLONEDDS_URI", own)
    domain.enter_domain()
    (settings,) = given
    ours = ElementTree.fromstring(settings.removesuffix(f",{own}"))
    # eProsima's number among DDS's vendors
    assert [one.text for one in ours.findall("Domain/Compatibility/IgnoreTypeInformation")] == ["1.15"]
    assert settings.endswith(own)  # comes last and overrules


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
    from catenary.crtk.dds import domain as standard_error

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
