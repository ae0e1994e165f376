"""What recording all topics of a RAVEN-II adds to a tick at 1 kHz, and seventeen minutes of it on the way to a motion log.

CPU time. Beside `Recorder.observe` the same samples are encoded with NumPy alone, without stamps, rates or a file; beside
it the messages of the same journal are read one by one.
"""

import tempfile
from pathlib import Path

import numpy as np

from catenary.raven2.topics import raven_topics
from catenary.recording.import_formats.raven_recordings import read_raven
from catenary.recording.journal_reader import JournalReader
from catenary.recording.recorder import Recorder
from catenary.recording.topic_samples import encode
from tests.benchmarks.measure import Tables, cpu_time, report
from tests.oracles.raven_recording import record_minutes, telemetry, write_bag

TICKS = 3000
ROUNDS = 5
PERIOD = 1e-3  # [s]


def tick_tables() -> Tables:
    """Time a tick of each."""
    times = PERIOD * np.arange(TICKS)
    stamp = np.arange(TICKS, dtype=np.int64) * 1_000_000
    columns = telemetry(times, np.random.default_rng(1))
    rows = [{name: values[i] for name, values in columns.items()} for i in range(TICKS)]

    def encode_alone() -> None:
        for topic in raven_topics():
            every = max(1, round(1.0 / (PERIOD * topic.rate)))
            for i in range(0, TICKS, every):
                encode(topic, stamp[i : i + 1], {name: values[i : i + 1] for name, values in columns.items()})

    spent: dict[str, list[float]] = {"Recorder.observe": [], "encoded alone": []}
    for _ in range(ROUNDS):
        with (
            tempfile.TemporaryDirectory() as folder,
            Recorder(Path(folder) / "r", raven_topics(), columns, np.random.default_rng(2)) as recorder,
        ):

            def observe(recorder: Recorder = recorder) -> None:
                for t, row in zip(times, rows, strict=True):
                    recorder.observe(float(t), row)

            spent["Recorder.observe"].append(cpu_time(observe))
        spent["encoded alone"].append(cpu_time(encode_alone))
    median = {name: 1e6 * float(np.median(values)) / TICKS for name, values in spent.items()}
    first = median["Recorder.observe"]
    found = {name: {"cpu_us": value, "ratio": value / first} for name, value in median.items()}
    return {"recording all topics of a RAVEN-II, a tick at 1 kHz": found}


MINUTES = 17


def log_tables() -> Tables:
    """Time both ways to a motion log, and the messages alone."""
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        journal = record_minutes(folder / "journal", MINUTES)
        bags = [write_bag(journal, folder / "recording.bag")]
        read_raven(bags)  # imports, compiled code
        spent = {
            "messages read alone": cpu_time(lambda: sum(1 for _ in JournalReader(journal).messages())),
            "journal to log": cpu_time(lambda: read_raven([journal])),
            "bag to log": cpu_time(lambda: read_raven(bags)),
        }
    bare = spent["messages read alone"]
    rows = {name: {"cpu_s": seconds, "ratio": seconds / bare} for name, seconds in spent.items()}
    return {f"{MINUTES} minutes of a RAVEN-II": rows}


def tables() -> Tables:
    """Time a tick, and both ways to a log."""
    return {**tick_tables(), **log_tables()}


if __name__ == "__main__":
    report(tables, __doc__)
