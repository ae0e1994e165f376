"""Other programs that publish an arm's joints, over any transport: robots of a name that is taken."""

import json
import os
import sys
import threading
from collections.abc import Callable

import numpy as np

from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import operating_state_message
from catenary.crtk.network import TRANSPORTS
from catenary.crtk.topic_names import find_topic
from catenary.crtk.transport import Transport
from catenary.plant import OperatingState
from ros import ROOT, Program

JOINT_STATE = "sensor_msgs/JointState"


def publish(transport: Transport, topic: str, every: float, ended: threading.Event, begun: Callable[[], None]) -> None:
    """Publish one joint `every` so often [s], never when 0; below /arm1 with what a client of `crtk` wants to hear."""
    publisher = transport.publisher(topic, JOINT_STATE)
    rest = []
    if topic == "/arm1/measured_js":
        for verb in ("setpoint_js", "operating_state", "servo_jp", "state_command"):
            found = find_topic("crtk", verb, "gold")
            if found.direction == "in":
                transport.subscribe(found.name, found.type, depth=1)
            else:
                rest.append(transport.publisher(found.name, found.type))
    begun()
    while not ended.wait(every or 0.1):
        stamp = transport.now()
        joints = message_class(JOINT_STATE)(header(stamp), ("a",), np.zeros(1))
        if every:
            publisher.publish(joints)
            for other, message in zip(
                rest, (joints, operating_state_message(OperatingState("ENABLED", True, False), stamp)), strict=False
            ):
                other.publish(message)


class Rivals:
    """Programs by name, each with joints of its own, beside a transport of a kind."""

    def __init__(self, transport: Transport, kind: str) -> None:
        places = [str(ROOT / "src"), str(ROOT / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])]
        self.environment = {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
        self._transport, self._kind = transport, kind
        self._ends: dict[str, Callable[[], object]] = {}

    def begin(self, topic: str, *, every: float = 0.01, name: str = "rival") -> None:
        """Have one publish joints `every` so often [s]; never when 0."""
        if isinstance(self._transport, Loopback):
            other, ended, begun = Loopback(name, self._transport.network), threading.Event(), threading.Event()
            thread = threading.Thread(target=publish, args=(other, topic, every, ended, begun.set))
            thread.start()
            begun.wait()
            self._ends[name] = lambda: (ended.set(), thread.join(), other.close())
            return
        program = Program(self, "from rival_robot import main; main()", json.dumps([self._kind, name, topic, every]))
        self._ends[name] = program.__exit__
        assert program.line() == "up"

    def kill(self, name: str = "rival") -> None:
        """End one as a crash does."""
        self._ends.pop(name)()

    def close(self) -> None:
        """End all."""
        for name in tuple(self._ends):
            self.kill(name)


def main() -> None:
    """Be such a program."""
    kind, name, topic, every = json.loads(sys.argv[1])
    transport = TRANSPORTS[kind].make(name)
    publish(transport, topic, every, threading.Event(), lambda: print("up", flush=True))  # noqa: T201
