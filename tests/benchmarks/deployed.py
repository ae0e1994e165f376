"""`catenary deploy --ros 1` beside a served robot at 1 kHz: share corrected, latency, processor time, memory.

`python -m tests.benchmarks.deployed --seconds 60`; needs rospy and its master, and starts a master of its own. A listener
takes what is published, as a program that uses it would.
"""

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # `ros`, as pytest finds it

from benchmarks.programs import CATENARY, cpu_seconds, memory, options, tell
from catenary import MotionLog
from catenary.calibration.files import save_model
from recordings import fitted
from ros import Program, running_master

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


def write_model(file: Path, kind: str) -> None:
    """A model of the RAVEN-II's first three joints, trusted nearly everywhere."""
    rng = np.random.default_rng(0)
    q = np.array([0.5, 1.5, 0.4]) + np.array([0.5, 0.5, 0.1]) * rng.uniform(-1.0, 1.0, (2000, 3))
    names = ("shoulder", "elbow", "insertion")
    true = q + 0.01 * np.sin(3.0 * q)
    log = MotionLog(
        "run", names, ("rad", "rad", "m"), q, np.ones(len(q), dtype=bool), true, time=np.arange(2000) / 30.0
    )
    inputs = tuple(f"q:{name}" for name in names)
    save_model(fitted(log, kind=kind, inputs=inputs), {}, file)


def measure(kind: str, seconds: float) -> dict[str, Any]:
    """Deploy a model beside a homed robot."""
    with (
        tempfile.TemporaryDirectory() as folder,
        running_master(Path(folder)) as master,
        Program(master, CATENARY, "serve", "--homed", "--json") as server,
    ):
        write_model(Path(folder) / "arm.npz", kind)
        server.line()
        deploy = ("deploy", str(Path(folder) / "arm.npz"), "--ros", "1", "--gravity-torque", "--json")
        with Program(master, LISTENER) as listener, Program(master, CATENARY, *deploy) as deployed:
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
        "seconds": report["seconds"],
        "hertz": report["rate_hz"],
        "messages": report["messages"],
        **{name: report[name] for name in ("published", "late", "missed", "silences")},
        **{f"{name}_ms": value / 1e3 for name, value in report["latency_us"].items()},
        "cores": cores,
        "memory_growth_mb": growth,
    }


def main() -> None:
    """Measure, print, and write JSON where `--json FILE` says."""
    given = options(__doc__, kind=("linear", "neural"))
    tell({kind: measure(kind, given.seconds) for kind in given.kind}, given.json)


if __name__ == "__main__":
    main()
