"""Long bags are read without their index, and say the same."""

from pathlib import Path

import pytest

from catenary.errors import FileFormatError
from catenary.recording import source
from catenary.recording.bag import BagReader, write_bag
from catenary.recording.journal_reader import JournalReader
from catenary.recording.salvage import SalvageReader
from catenary.recording.source import open_recording
from oracles.raven_recording import record


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    write_bag(JournalReader(record(folder / "journal", 10.0)), folder / "a.bag")
    return folder / "a.bag"


def test_long_bag_gives_the_same_without_its_index(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    indexed = open_recording(bag)
    assert isinstance(indexed, BagReader)
    monkeypatch.setattr(source, "STREAMED", 0)
    streamed = open_recording(bag)
    assert isinstance(streamed, SalvageReader)
    assert list(streamed.messages()) == list(indexed.messages())
    assert (set(streamed.topics), streamed.about) == (set(indexed.topics), indexed.about)
    assert streamed.problems == []


def test_long_bag_that_was_cut_off_is_refused_like_a_short_one(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(source, "STREAMED", 0)
    cut = tmp_path / "cut.bag"
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    with pytest.raises(FileFormatError, match="can be saved"):
        open_recording(cut)
