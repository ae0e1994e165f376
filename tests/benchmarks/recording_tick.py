"""What recording all topics of a RAVEN-II adds to a tick of a 1 kHz loop: CPU time of `Recorder.observe`.

Beside it the same samples encoded with NumPy alone, message by message, without stamps, rates or a file.
"""

import tempfile
from pathlib import Path

import numpy as np

from catenary.recording.recorder import Recorder
from catenary.recording.topics import encode, raven_topics
from tests.benchmarks.measure import Tables, cpu_time, report
from tests.oracles.raven_recording import telemetry

TICKS = 3000
ROUNDS = 5
PERIOD = 1e-3  # [s]


def tables() -> Tables:
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


if __name__ == "__main__":
    report(tables, __doc__)
