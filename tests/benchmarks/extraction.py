"""A calibration recording of seventeen minutes, from journal and from ROS 1 bag to a motion log: seconds of CPU time.

Beside it the messages of the same journal, read one by one.
"""

import tempfile
from pathlib import Path

from catenary.recording.extract import extract
from catenary.recording.import_formats.known_layouts import read_raven
from catenary.recording.journal_reader import JournalReader
from tests.benchmarks.measure import Tables, cpu_time, report
from tests.oracles.raven_recording import record_minutes, write_bag

MINUTES = 17


def to_log(paths: list[Path], folder: Path) -> None:
    """Extract and synchronise."""
    extract(paths, folder)
    read_raven([folder])


def tables() -> Tables:
    """Time both ways to a motion log, and the messages alone."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        journal = record_minutes(folder / "journal", MINUTES)
        bags = [write_bag(journal, folder / "recording.bag")]
        to_log(bags, folder / "warm")  # imports, compiled code
        spent = {
            "messages read alone": cpu_time(lambda: sum(1 for _ in JournalReader(journal).messages())),
            "journal to log": cpu_time(lambda: to_log([journal], folder / "from journal")),
            "bag to log": cpu_time(lambda: to_log(bags, folder / "from bag")),
        }
    bare = spent["messages read alone"]
    rows = {name: {"cpu_s": seconds, "ratio": seconds / bare} for name, seconds in spent.items()}
    return {f"{MINUTES} minutes of a RAVEN-II": rows}


if __name__ == "__main__":
    report(tables, __doc__)
