"""What recording all topics of a RAVEN-II adds to a tick of a 1 kHz loop: CPU time of `Recorder.observe`.

Beside it the same samples encoded with NumPy alone, message by message, without stamps, rates or a file.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from catenary.recording.recorder import Recorder
from catenary.recording.topics import encode, raven_topics
from tests.benchmarks.measure import tell
from tests.oracles.raven_recording import telemetry

TICKS = 3000
ROUNDS = 5
PERIOD = 1e-3  # [s]


def main() -> None:
    """Measure, and tell."""
    times = PERIOD * np.arange(TICKS)
    stamp = np.arange(TICKS, dtype=np.int64) * 1_000_000
    columns = telemetry(times, np.random.default_rng(1))
    rows = [{name: values[i] for name, values in columns.items()} for i in range(TICKS)]
    spent: dict[str, list[float]] = {"Recorder.observe": [], "encoded alone": []}
    for _ in range(ROUNDS):
        with (
            tempfile.TemporaryDirectory() as folder,
            Recorder(Path(folder) / "r", raven_topics(), columns, np.random.default_rng(2)) as recorder,
        ):
            begin = time.process_time()
            for t, row in zip(times, rows, strict=True):
                recorder.observe(float(t), row)
            spent["Recorder.observe"].append((time.process_time() - begin) / TICKS)
        begin = time.process_time()
        for topic in raven_topics():
            every = max(1, round(1.0 / (PERIOD * topic.rate)))
            for i in range(0, TICKS, every):
                encode(topic, stamp[i : i + 1], {name: values[i : i + 1] for name, values in columns.items()})
        spent["encoded alone"].append((time.process_time() - begin) / TICKS)
    first = float(np.median(spent["Recorder.observe"]))
    table = {
        name: {"cpu_us": 1e6 * float(np.median(values)), "ratio": float(np.median(values)) / first}
        for name, values in spent.items()
    }
    tell({"recording all topics of a RAVEN-II, a tick at 1 kHz": table})


if __name__ == "__main__":
    main()
