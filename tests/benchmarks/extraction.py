"""A calibration recording of seventeen minutes, from journal and from ROS 1 bag to a motion log: seconds of CPU time.

Beside it the messages of the same journal, read one by one.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from catenary.recording.bag import write_bag
from catenary.recording.extract import extract
from catenary.recording.journal_reader import JournalReader
from catenary.recording.synchronise import synchronise
from tests.benchmarks.measure import tell
from tests.oracles.raven_recording import record_minutes

MINUTES = 17


def main() -> None:
    """Measure, and tell."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        journal = record_minutes(folder / "journal", MINUTES)
        bags = [*write_bag(JournalReader(journal), folder / "recording.bag")]
        to_log(bags, folder / "warm")  # imports, compiled code
        bare = cpu(lambda: sum(1 for _ in JournalReader(journal).messages()))
        table = {
            "messages read alone": bare,
            "journal to log": cpu(lambda: to_log([journal], folder / "from journal")),
            "bag to log": cpu(lambda: to_log(bags, folder / "from bag")),
        }
    tell(
        {
            f"{MINUTES} minutes of a RAVEN-II": {
                name: {"cpu_s": seconds, "ratio": seconds / bare} for name, seconds in table.items()
            }
        }
    )


def to_log(paths: list[Path], folder: Path) -> None:
    """Extract and synchronise."""
    extract(paths, folder)
    synchronise(folder)


def cpu(do: Callable[[], Any]) -> float:
    """Seconds of processor time that it takes."""
    begin = time.process_time()
    do()
    return time.process_time() - begin


if __name__ == "__main__":
    main()
