"""`catenary serve` over ROS 1 beside a client that hears every topic: rate, loss, latency, processor time, memory.

`make bench-serving`, or `python -m tests.benchmarks.serving --seconds 600`; needs rospy and its master, and starts a
master of its own. Percentiles, since a maximum measures the machine. Two listeners, one after the other: one that reads
its sockets and nothing else, and one of catenary's own clients, by rospy.
"""

from tests.benchmarks.measure import Tables
from tests.benchmarks.programs import master_and_folder, report_of_programs
from tests.benchmarks.served import served_to

LISTENER = "from benchmarks.listener import main; main()"


def measure(dialect: str, listener: str, seconds: float) -> dict[str, float]:
    """Serve a homed robot to one client that hears everything and commands at 100 Hz."""
    with master_and_folder() as (master, _):
        return served_to(master, (), dialect, LISTENER, (listener,), seconds)


def tables(seconds: float, dialect: tuple[str, ...], listener: tuple[str, ...]) -> Tables:
    """Measure every dialect beside every listener."""
    rows = {f"{spoken}, {by}": measure(spoken, by, seconds) for by in listener for spoken in dialect}
    return {"a served robot": rows}


if __name__ == "__main__":
    choices = {"dialect": ("raven", "crtk"), "listener": ("sockets", "rospy")}
    report_of_programs(tables, __doc__, seconds=20.0, **choices)
