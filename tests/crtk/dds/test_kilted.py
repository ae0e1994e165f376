"""ROS 2 Kilted itself, from its wheels, with Fast DDS 3, its default; .ci/run installs it."""

import os
import subprocess
import threading
from pathlib import Path
from typing import Any

import pytest

from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from dds import ROOT, VARIABLES
from patience import until

KILTED = Path(os.environ.get("CATENARY_KILTED", ROOT / ".cache" / "kilted")) / "bin" / "python"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not KILTED.is_file(), reason=f"ROS 2 Kilted is not installed: no {KILTED}; .ci/run makes it"),
]
# says what it hears on topics with sequences, and sends a joint state, until its input ends
PEER = """
import sys, threading, rclpy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("peer")
heard = set()
def hears(text):
    if text not in heard:
        heard.add(text)
        print(text, flush=True)
node.create_subscription(JointState, "/ours/joints", lambda m: hears(f"{m.name} {list(m.position)}"), 10)
node.create_subscription(DiagnosticArray, "/ours/diagnostics", lambda m: hears(m.status[0].name), 10)
publisher = node.create_publisher(JointState, "/theirs/joints", 10)
threading.Thread(target=lambda: (sys.stdin.read(), rclpy.shutdown()), daemon=True).start()
while rclpy.ok():
    publisher.publish(JointState(name=["a", "b"], position=[1.5, -2.0]))
    try:
        rclpy.spin_once(node, timeout_sec=0.05)
    except Exception:
        pass
"""


@pytest.mark.parametrize("own", ["", ",<General><MaxMessageSize>14720B</MaxMessageSize></General>"])
def test_kilted_hears_us_and_is_heard(monkeypatch: pytest.MonkeyPatch, dds_domain: int, own: str) -> None:
    from catenary.crtk.dds.transport import DdsTransport

    monkeypatch.setenv("CYCLONEDDS_URI", os.environ["CYCLONEDDS_URI"] + own)  # a user has settings too
    left_out = {*VARIABLES, "CYCLONEDDS_URI", "PYTHONPATH"}
    kept = {name: value for name, value in os.environ.items() if name not in left_out}
    with (
        DdsTransport("robot", settle=0.05) as robot,
        subprocess.Popen(
            [KILTED, "-u", "-c", PEER],
            env={**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as peer,
    ):
        assert peer.stdin is not None
        assert peer.stdout is not None
        said: list[str] = []
        threading.Thread(target=said.extend, args=(map(str.strip, peer.stdout),), daemon=True).start()
        joints = robot.publisher("/ours/joints", "sensor_msgs/JointState")
        diagnostics = robot.publisher("/ours/diagnostics", "diagnostic_msgs/DiagnosticArray")
        array, status = (message_class(f"diagnostic_msgs/Diagnostic{name}") for name in ("Array", "Status"))
        heard = robot.subscribe("/theirs/joints", "sensor_msgs/JointState")

        def both_heard() -> bool:
            joints.publish(joint_state_message(("x", "y"), robot.now(), (0.5, 0.25)))
            diagnostics.publish(array(header(robot.now()), (status(0, "arm", "ENABLED", "", ()),)))
            return {"['x', 'y'] [0.5, 0.25]", "arm"} == {*said} and len(heard) > 0

        try:
            until(both_heard, every=0.05)
        finally:
            peer.stdin.close()
        message: Any = heard.take()[-1].message
    assert (message.name, list(message.position)) == (("a", "b"), [1.5, -2.0])
