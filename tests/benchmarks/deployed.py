"""`catenary deploy --ros 1` beside a served robot at 1 kHz: share corrected, latency, processor time, memory.

`python -m tests.benchmarks.deployed --seconds 60`; needs rospy and its master, and starts a master of its own. A listener
takes what is published, as a program that uses it would.
"""

import json
import time

import numpy as np

import catenary
from ros import COMMAND, Program
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.programs import cpu_seconds, master_and_folder, memory, require_rospy

LISTENER = """
import sys, time
from catenary.crtk.ros1.transport import Ros1Transport
transport = Ros1Transport("listener")
types = {"measured_js": "sensor_msgs/JointState", "measured_cp": "geometry_msgs/TransformStamped",
         "is_valid": "std_msgs/Bool", "gravity_torque": "sensor_msgs/JointState"}
heard = [transport.subscribe(f"/arm1/calibrated/{verb}", kind, depth=1) for verb, kind in types.items()]
while not len(heard[0]):
    time.sleep(0.01)
print("heard")
time.sleep(1e6)
"""


def measure(kind: str, seconds: float) -> dict[str, float]:
    """Deploy a model of the RAVEN-II's first three joints, trusted nearly everywhere, beside a homed robot."""
    rng = np.random.default_rng(0)
    q = np.array([0.5, 1.5, 0.4]) + np.array([0.5, 0.5, 0.1]) * rng.uniform(-1.0, 1.0, (2000, 3))
    names = ("shoulder", "elbow", "insertion")
    true, time_s = q + 0.01 * np.sin(3.0 * q), np.arange(2000) / 30.0
    units = ("rad", "rad", "m")
    model = catenary.fit(q, true, units=units, joint_names=names, time=time_s, model=kind)
    with master_and_folder() as (master, folder), Program(master, COMMAND, "serve", "--homed", "--json") as server:
        model.save(folder / "arm.npz")
        server.line()
        deploy = ("deploy", str(folder / "arm.npz"), "--ros", "1", "--gravity-torque", "--json")
        with Program(master, LISTENER) as listener, Program(master, COMMAND, *deploy) as deployed:
            listener.line()
            time.sleep(1.0)
            pid = deployed.process.pid
            began, cpu, size = time.monotonic(), cpu_seconds(pid), memory(pid)
            time.sleep(seconds)
            cores = (cpu_seconds(pid) - cpu) / (time.monotonic() - began)
            growth = memory(pid) - size
            deployed.interrupt()
            report = json.loads(deployed.finish()[0])
    return {
        "hertz": report["rate_hz"],
        **{name: report[name] for name in ("seconds", "messages", "published", "late", "missed", "silences")},
        **{f"{name}_ms": value / 1e3 for name, value in report["latency_us"].items()},
        "cores": cores,
        "memory_growth_mb": growth,
    }


def tables(seconds: float, kind: tuple[str, ...]) -> Tables:
    """Measure every kind of model."""
    return {"a deployed model": {each: measure(each, seconds) for each in kind}}


if __name__ == "__main__":
    require_rospy()
    report(tables, __doc__, seconds=20.0, kind=("linear", "neural"))
