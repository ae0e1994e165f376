"""Real ROS 2, from its wheels: distributions that are installed here, and programs of theirs that talk with ours."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dds import ROOT, VARIABLES

DISTRIBUTIONS = ("kilted", "jazzy")  # Fast DDS 3 and 2, each its distribution's default
# reads JSON commands, one a line, and answers each with a line: a node of rclpy that hears, says and looks about
PEER = """
import importlib, importlib.util, json, sys, threading, time
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
rclpy.init()
node = rclpy.create_node("peer")
heard, publishers = {}, {}
def kind(name):
    package, message = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), message)
def quality(depth=10, reliable=True, latched=False):
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
def fill(message, values):
    for name, value in values.items():
        part = getattr(message, name)
        if isinstance(value, dict):
            fill(part, value)
        else:
            setattr(message, name, value)
    return message
def plain(value):
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bool, int, float)):
        return value
    return [plain(one) for one in value]
def hear(topic, type, **asked):
    rows = heard[topic] = []
    node.create_subscription(kind(type), topic, lambda m: rows.append((time.time(), m)), quality(**asked))
def say(topic, type, values, times=1, rate=50.0, **asked):
    if topic not in publishers:
        publishers[topic] = node.create_publisher(kind(type), topic, quality(**asked))
    publisher, message = publishers[topic], fill(kind(type)(), values)
    end = time.time() + 10.0
    while publisher.get_subscription_count() == 0 and time.time() < end:
        time.sleep(0.01)
    for _ in range(times):
        publisher.publish(message)
        time.sleep(1.0 / rate)
    return publisher.get_subscription_count()
def count(topic):
    return len(heard[topic])
def last(topic):
    return plain(heard[topic][-1][1])
def span(topic):
    rows = heard[topic]
    return len(rows), rows[-1][0] - rows[0][0]
def nodes():
    return sorted(namespace.rstrip("/") + "/" + name for name, namespace in node.get_node_names_and_namespaces())
def ends(topic):
    found = node.get_publishers_info_by_topic(topic)
    return [[one.node_name, one.topic_type, one.topic_type_hash.value.hex() if hasattr(one.topic_type_hash, "value")
             else str(one.topic_type_hash), one.qos_profile.reliability.name, one.qos_profile.durability.name]
            for one in found]
def has(package):
    return importlib.util.find_spec(package) is not None
def services():
    return [name for name, _ in node.get_service_names_and_types() if not name.startswith("/peer/")]
executor = SingleThreadedExecutor()
executor.add_node(node)
def spin():
    try:
        executor.spin()
    except ExternalShutdownException:
        pass
threading.Thread(target=spin, daemon=True).start()
for line in sys.stdin:
    name, arguments = json.loads(line)
    try:
        print(json.dumps(["", globals()[name](**arguments)]), flush=True)
    except Exception as error:
        print(json.dumps([repr(error), None]), flush=True)
rclpy.shutdown()
"""


def place_of(distro: str) -> Path:
    """Return the folder of a distribution's environment."""
    return Path(os.environ.get(f"CATENARY_{distro.upper()}", ROOT / ".ros2" / distro))


def python_of(distro: str) -> Path:
    """Return the interpreter of a distribution's environment; skip where there is none."""
    found = place_of(distro) / "bin" / "python"
    if not found.is_file():
        pytest.skip(f"ROS 2 {distro} is not installed: no {found}; .ci/ros2 {distro} makes it")
    return found


class Peer:
    """A node of rclpy in a process of its own; its functions are called by name."""

    def __init__(self, distro: str, domain: int) -> None:
        left_out = {*VARIABLES, "CYCLONEDDS_URI", "PYTHONPATH"}
        kept = {name: value for name, value in os.environ.items() if name not in left_out}
        self._process = subprocess.Popen(
            [python_of(distro), "-u", "-c", PEER],
            env={**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(domain)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __call__(self, name: str, **arguments: object) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([name, arguments]), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        assert line, "the peer ended"
        error, answer = json.loads(line)
        assert not error, error
        return answer

    def __enter__(self) -> "Peer":
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.kill()
        self._process.communicate()


def sourced(distro: str) -> dict[str, str]:
    """Return the environment of a program of ours beside a distribution, as when its setup was sourced."""
    prefix = python_of(distro).parents[1]
    (packages,) = prefix.glob("lib/python3*/site-packages")
    if not list(packages.glob(f"rclpy/_rclpy_pybind11.cpython-{sys.version_info[0]}{sys.version_info[1]}-*")):
        pytest.skip(f"ROS 2 {distro} is there for another Python: {packages}")
    libraries = [str(prefix / "lib"), *map(str, packages.glob("ros_*.libs"))]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(packages), str(ROOT / "src"), str(ROOT / "tests")]),
        "LD_LIBRARY_PATH": os.pathsep.join(libraries),
        "AMENT_PREFIX_PATH": str(prefix),
        "ROS_DISTRO": distro,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTEST_ADDOPTS": "",
    }
