"""`catenary serve` over ROS 2 (DDS) beside a client that hears every topic: rate, loss, latency, processor time, memory.

`make bench-dds`, or `python -m tests.benchmarks.dds_serving --seconds 600`; on this machine's loopback interface, in a
domain of its own. Percentiles, since a maximum measures the machine.
"""

from dds import Network
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.served import served_to

LISTENER = "from benchmarks.dds_listener import main; main()"


def measure(dialect: str, seconds: float) -> dict[str, float]:
    """Serve a homed robot to one client that hears everything and commands at 100 Hz."""
    return served_to(Network(), ("--ros", "2"), dialect, LISTENER, (), seconds)


def tables(seconds: float, dialect: tuple[str, ...]) -> Tables:
    """Measure every dialect."""
    return {"a served robot over DDS": {spoken: measure(spoken, seconds) for spoken in dialect}}


if __name__ == "__main__":
    report(tables, __doc__, seconds=20.0, dialect=("raven", "crtk"))
