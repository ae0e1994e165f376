"""A user's environment: each variable of ROS 2's, ours by DDS and rclpy, both ways, whoever starts first.

The programs share a network namespace with an interface beside loopback, as on a computer in a laboratory; where that is
not permitted they are skipped, and say so.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import pytest

from dds import ROOT, VARIABLES
from ros2 import DISTRIBUTIONS, python_of

# cases that `make test` tries, as whoever follows docs/safety.md has them; the others take minutes
USUAL = ("localhost", "localhost only", "one is localhost")
# each says its own words ten times a second, and prints what it hears of the other's, once
THEIRS = """
import sys, rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("theirs")
said = node.create_publisher(String, sys.argv[1], 10)
kept = node.create_subscription(String, sys.argv[2], lambda message: print(message.data, flush=True), 10)
node.create_timer(0.1, lambda: said.publish(String(data="rclpy")))
rclpy.spin(node)
"""
OURS = """
import sys
from catenary.crtk.message import message_class
from catenary.crtk.network import make_transport, parse_ros_arguments, say_ros_arguments
say_ros_arguments(parse_ros_arguments(sys.argv[3:]))
with make_transport("2", "ours") as transport:
    said = transport.publisher(sys.argv[1], "std_msgs/String")
    heard = transport.subscribe(sys.argv[2], "std_msgs/String")
    while True:
        said.publish(message_class("std_msgs/String")("ours"))
        for message, _ in heard.take():
            print(message.data, flush=True)
        transport.sleep(0.1)
"""
PATIENCE, SILENCE = 20.0, 4.0  # [s] to hear one that is there, and to hear nothing of one that is not to be heard
PLACES = "10.77.0.1", "10.77.0.2"  # of the two computers


class Case(NamedTuple):
    """What a user set, for both programs or else for one of them."""

    both: dict[str, str]
    heard: bool = True
    ours: dict[str, str] = {}  # noqa: RUF012  # nobody changes it
    theirs: dict[str, str] = {}  # noqa: RUF012
    arguments: tuple[str, ...] = ()
    topics: tuple[str, str] = ("/ours", "/theirs")  # as our program calls them


RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
INTERFACE = '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="{}"/></Interfaces></General></Domain></CycloneDDS>'
CASES = {
    "nothing": Case({}),
    "subnet": Case({RANGE: "SUBNET"}),
    "localhost": Case({RANGE: "LOCALHOST"}),
    "off": Case({RANGE: "OFF"}, heard=False),
    "one is off": Case({}, heard=False, ours={RANGE: "OFF"}),
    "system default": Case({RANGE: "SYSTEM_DEFAULT"}),
    "peers": Case({RANGE: "LOCALHOST", "ROS_STATIC_PEERS": PLACES[0]}),
    "localhost only": Case({"ROS_LOCALHOST_ONLY": "1"}),
    "ours localhost": Case({}, ours={RANGE: "LOCALHOST"}),
    "theirs localhost": Case({}, theirs={RANGE: "LOCALHOST"}),
    "domain": Case({"ROS_DOMAIN_ID": "42"}),
    "another domain": Case({}, heard=False, theirs={"ROS_DOMAIN_ID": "43"}),
    "namespace": Case({"ROS_NAMESPACE": "/lab"}),  # which no ROS 2 knows
    "remapped": Case({}, arguments=("-r", "/said:=/ours", "-r", "/asked:=/theirs"), topics=("/said", "/asked")),
    "rmw": Case({"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}),
    "cyclone on lo": Case({RANGE: "LOCALHOST"}, ours={"CYCLONEDDS_URI": INTERFACE.format("lo")}),
    "cyclone by a file": Case({RANGE: "LOCALHOST"}, ours={"CYCLONEDDS_URI": "file://{file}"}),
    "cyclone elsewhere": Case({}, ours={"CYCLONEDDS_URI": INTERFACE.format("v0")}),
    "cyclone elsewhere, localhost": Case({RANGE: "LOCALHOST"}, ours={"CYCLONEDDS_URI": INTERFACE.format("v0")}),
}


# the same on two computers; both programs get the first variables, theirs the second besides
FAR = {
    "nothing": Case({}),
    "localhost": Case({RANGE: "LOCALHOST"}, heard=False),
    "one is localhost": Case({}, heard=False, ours={RANGE: "LOCALHOST"}),
    "localhost only": Case({}, heard=False, ours={"ROS_LOCALHOST_ONLY": "1"}),
    "peers": Case({RANGE: "LOCALHOST"}, ours={"ROS_STATIC_PEERS": PLACES[1]}, theirs={"ROS_STATIC_PEERS": PLACES[0]}),
    "off": Case({}, heard=False, ours={RANGE: "OFF"}),
}


@pytest.fixture(scope="module")
def places() -> Iterator[list[str]]:
    """Network namespaces of two computers with a cable between them."""
    names = [f"catenary_{os.getpid()}_{k}" for k in (0, 1)]
    try:
        for name in names:
            made = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
            if made.returncode:
                pytest.skip(f"no network namespace of its own can be made here: {made.stderr.strip()}")
        cable = ["link", "add", "v0", "type", "veth", "peer", "name", "v0", "netns", names[1]]
        subprocess.run(["ip", "-n", names[0], *cable], check=True)
        for name, address in zip(names, PLACES, strict=True):
            for words in (f"address add {address}/24 dev v0", "link set lo up", "link set v0 up"):
                subprocess.run(["ip", "-n", name, *words.split()], check=True)
        yield names
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)


@contextmanager
def program(place: str, python: str, text: str, variables: dict[str, str], words: list[str]) -> Iterator[list[str]]:
    """Run it in a network namespace; the list gets the lines that it prints."""
    lines: list[str] = []
    left_out = {*VARIABLES, "CYCLONEDDS_URI", "PYTHONPATH", "ROS_DOMAIN_ID"}
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    command = ["ip", "netns", "exec", place, python, "-u", "-c", text, *words]
    with subprocess.Popen(command, env=kept | variables, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        reader = Thread(target=lambda stream=run.stdout: lines.extend(stream))
        reader.start()
        try:
            yield lines
            assert run.poll() is None, "a program ended"
        finally:
            run.kill()
            reader.join()


Program = tuple[str, str, str, dict[str, str], list[str]]


def heard(first: Program, second: Program, case: Case) -> tuple[bool, bool]:
    """Start one, and the other when it is there; return which of them heard the other."""
    with program(*first) as lines:
        time.sleep(2.0 if case.heard else 0.5)
        with program(*second) as others:
            end = time.monotonic() + (PATIENCE if case.heard else SILENCE)
            while time.monotonic() < end and not (lines and others):
                time.sleep(0.05)
            return bool(lines), bool(others)


def ours(place: str, case: Case) -> Program:
    """Return our program of a case."""
    variables = {"PYTHONPATH": str(ROOT / "src"), **case.both, **case.ours}
    return place, sys.executable, OURS, variables, [*case.topics, *case.arguments]


def theirs(place: str, case: Case, distro: str) -> Program:
    """Return theirs; it may be another one of ours."""
    variables = {**case.both, **case.theirs}
    if distro == "dds":
        return ours(place, Case(variables, topics=("/theirs", "/ours")))
    return place, str(python_of(distro)), THEIRS, variables, ["/theirs", "/ours"]


def usual_first(cases: dict[str, Case]) -> list[Any]:
    """Return the names of cases, all but those that are usual as slow ones."""
    return [pytest.param(name, marks=() if name in USUAL else pytest.mark.slow) for name in cases]


@pytest.mark.parametrize("distro", DISTRIBUTIONS)
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("name", usual_first(CASES))
def test_programs_hear_each_other_just_where_their_variables_say_so(
    places: list[str], distro: str, is_first: bool, name: str, tmp_path: Path
) -> None:
    case, file = CASES[name], tmp_path / "cyclone.xml"
    file.write_text(INTERFACE.format("lo"))
    case = case._replace(ours={key: value.replace("{file}", str(file)) for key, value in case.ours.items()})
    both = [ours(places[0], case), theirs(places[0], case, distro)]
    assert heard(*(both if is_first else both[::-1]), case) == (case.heard, case.heard)


@pytest.mark.parametrize("range_", ["SUBNET", "LOCALHOST"])
def test_a_computer_without_a_network_is_one_too(places: list[str], range_: str) -> None:
    case, name = Case({RANGE: range_}), f"{places[0]}_offline"
    subprocess.run(["ip", "netns", "add", name], check=True)
    try:
        subprocess.run(["ip", "-n", name, "link", "set", "lo", "up"], check=True)
        assert heard(ours(name, case), theirs(name, case, "dds"), case) == (True, True)
    finally:
        subprocess.run(["ip", "netns", "delete", name], check=True)


@pytest.mark.parametrize("distro", [*DISTRIBUTIONS, "dds"])
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("name", usual_first(FAR))
def test_programs_on_two_computers_hear_each_other_just_where_their_variables_say_so(
    places: list[str], distro: str, is_first: bool, name: str
) -> None:
    case = FAR[name]
    both = [ours(places[0], case), theirs(places[1], case, distro)]
    assert heard(*(both if is_first else both[::-1]), case) == (case.heard, case.heard)
