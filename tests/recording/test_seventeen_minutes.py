"""The figures that docs/formats.md promises for a calibration recording."""

import time
from pathlib import Path

import numpy as np
import pytest

from catenary.recording.bag import write_bag
from catenary.recording.extract import extract
from catenary.recording.journal_reader import JournalReader
from catenary.recording.recorder import Recorder
from catenary.recording.synchronise import synchronise
from catenary.recording.topics import raven_topics
from oracles.raven_recording import telemetry

SECONDS = 1020
LIMIT = 10.0  # [s] of processor time; a shared machine's clock says little


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["journal", "bag"])
def test_seventeen_minutes_are_extracted_and_synchronised_in_ten_seconds(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(1)
    step = 0.005
    columns = telemetry(np.zeros(2), rng)
    with Recorder(tmp_path / "r", raven_topics()[:3], columns, np.random.default_rng(2)) as recorder:
        for minute in range(SECONDS // 60):
            ticks = 60.0 * minute + step * np.arange(round(60 / step))
            recorder.observe_many(ticks, telemetry(ticks, rng))
    paths = (
        [tmp_path / "r"]
        if kind == "journal"
        else [*write_bag(JournalReader(tmp_path / "r"), tmp_path / "a.bag")]
    )
    start = time.process_time()
    extract(paths, tmp_path / "x")
    result = synchronise(tmp_path / "x")
    assert time.process_time() - start < LIMIT
    assert len(result.log) > 29 * SECONDS
    assert result.log.ok[:-1].all()
