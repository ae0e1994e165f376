"""A calibration recording of usual length."""

from pathlib import Path

import pytest

from catenary.recording.bag_reader import JournalReader
from catenary.recording.bag_writer import write_group_bags
from catenary.recording.import_formats.known_layouts import read_raven
from oracles.raven_recording import record_minutes

MINUTES = 17


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["journal", "bag"])
def test_seventeen_minutes_are_synchronised_whole(tmp_path: Path, kind: str) -> None:
    journal = record_minutes(tmp_path / "r", MINUTES)
    paths = [journal] if kind == "journal" else [*write_group_bags(JournalReader(journal), tmp_path)]
    result = read_raven(paths)
    assert len(result.log) > 29 * 60 * MINUTES
    assert result.log.ok[:-1].all()
