"""ROS 1 between two processes of this machine: loss and latency of a JointState, and what a whole RAVEN-II costs.

`make bench-ros1`, or `python -m tests.benchmarks.ros1_throughput`; needs rospy and its master (`apt install python3-rospy
python3-rosmaster python3-std-msgs`), and starts a master of its own. Percentiles, since a maximum measures the machine.
"""

import json

from catenary.crtk.topic_names import RAVEN
from ros import Program
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.programs import master_and_folder, require_rospy

SECONDS = 10.0
JOINT_STATE = "sensor_msgs/JointState"
RECEIVER = """
import json, sys, time
import numpy as np
from catenary.crtk.ros1.transport import Ros1Transport
transport = Ros1Transport("receiver")
topics = json.loads(sys.argv[1])
all = {topic: transport.subscribe(topic, kind, depth=1_000_000) for topic, kind in topics}
timed = all["/latency"] if "/latency" in all else None
print("listening")
while not any(map(len, all.values())):
    time.sleep(0.01)
begin = time.process_time(), time.monotonic()
sys.stdin.readline()
share = (time.process_time() - begin[0]) / (time.monotonic() - begin[1])
time.sleep(0.5)
latency = [] if timed is None else [one.time - one.message.header.stamp for one in timed.take()]
print(json.dumps({"received": len(latency) or sum(map(len, all.values())), "cpu": share,
                  "us": [float(x) / 1e3 for x in np.quantile(latency, (0.5, 0.99))] if latency else []}))
"""
SENDER = """
import json, sys, time
import numpy as np
from catenary.crtk.message import message_class, header
from catenary.crtk.ros1.transport import Ros1Transport
transport = Ros1Transport("sender")
seconds, topics = float(sys.argv[2]), json.loads(sys.argv[1])
publishers = [(transport.publisher(topic, kind, queue=1000), message_class(kind)) for topic, kind in topics]
while not all(transport.connections(topic).subscribers for topic, _ in topics):
    time.sleep(0.01)
time.sleep(0.5)
joints = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")
numbers, axes, counts = np.linspace(0.0, 1.0, 7), np.linspace(0.0, 1.0, 16), np.arange(16)
def made(kind, now):
    name = kind.__name__
    if name == "JointState":
        return kind(header(now), joints, numbers, numbers, numbers)
    if name == "raven_state":
        return kind(hdr=header(now), encVals=counts, dac_val=counts, tau=axes, mpos=axes, jpos=axes, mvel=axes,
                    jvel=axes, mpos_d=axes, jpos_d=axes)
    return kind(header=header(now))
rate, ticks = transport.rate(1000.0), round(1000 * seconds)
begin = time.process_time(), time.monotonic()
for _ in range(ticks):
    for publisher, kind in publishers:
        publisher.publish(made(kind, transport.now()))
    rate.sleep()
wall = time.monotonic() - begin[1]
print(json.dumps({"sent": ticks * len(publishers), "cpu": (time.process_time() - begin[0]) / wall,
                  "hertz": ticks / wall, "overflowed": sum(p.overflowed for p, _ in publishers)}))
sys.stdin.readline()
"""


def raven_topics() -> list[tuple[str, str]]:
    """Return what a RAVEN-II publishes every millisecond."""
    out = (topic for topic in RAVEN if topic.direction == "out" and topic.verb != "joint_states")
    return [(topic.name, topic.type) for topic in out]


def measure(topics: list[tuple[str, str]]) -> dict[str, float]:
    """Send all topics at 1 kHz from one process to another."""
    with master_and_folder() as (master, _):
        listed = json.dumps(topics)
        with Program(master, RECEIVER, listed) as receiver:
            receiver.line()
            with Program(master, SENDER, listed, str(SECONDS)) as sender:
                sent = json.loads(sender.line())
                receiver.say("end")
                received = json.loads(receiver.line())
    latency = dict(zip(("p50_us", "p99_us"), received["us"], strict=False))
    return {
        "topics": len(topics),
        "hertz": sent["hertz"],
        "sent": sent["sent"],
        "lost": sent["sent"] - received["received"],
        "overflowed": sent["overflowed"],
        "sender_cores": sent["cpu"],
        "sender_us_a_tick": 1e6 * sent["cpu"] / sent["hertz"],
        "receiver_cores": received["cpu"],
        **latency,
    }


def tables() -> Tables:
    """Measure one topic, for its latency, and all of a robot."""
    rows = {"one JointState": measure([("/latency", JOINT_STATE)]), "whole RAVEN-II": measure(raven_topics())}
    return {f"{SECONDS:g} s at 1 kHz": rows}


if __name__ == "__main__":
    require_rospy()
    report(tables, __doc__)
