import errno
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.raven2.topics import EXT_JPOS, GREEN_MEASURED_JS, raven_topics
from catenary.recording import extract as extract_module
from catenary.recording import sqlite_bag
from catenary.recording.bag_writer import write_group_bags
from catenary.recording.extract import TopicFile, extract, topic_file
from catenary.recording.import_formats.raven_recordings import write_raven_csv
from catenary.recording.journal import About, JournalTopic, JournalWriter
from catenary.recording.journal_reader import JournalReader
from oracles.raven_recording import ABOUT, START_NS, encoder, nominal, record, write_bag


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("recording") / "journal", 10.0, max_bytes=400_000)


@pytest.fixture(scope="module")
def extracted(journal: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the journal's extraction."""
    return extract([journal], tmp_path_factory.mktemp("extraction") / "x").folder


def _columns(folder: Path, name: str) -> dict[str, np.ndarray]:
    table = pq.read_table(folder / f"{name}.parquet")
    return {column: table.column(column).to_numpy() for column in table.column_names}


def test_positions_come_out_in_radians_and_metres(extracted: Path) -> None:
    state = _columns(extracted, "ravenstate")
    time = (state["stamp"] - START_NS) / 1e9
    for i, joint in enumerate(("shoulder", "elbow", "insertion")):
        # atol: float32 degrees
        assert_allclose(state[f"jpos:gold_{joint}"], nominal(time)[:, i], atol=1e-7)
    rig = _columns(extracted, "ext_jpos")
    time = (rig["stamp"] - START_NS) / 1e9
    assert_allclose(rig["ext_jpos:insertion"], encoder(time)[:, 2], rtol=1e-12)  # float64


def test_units_and_origin_are_in_the_schema(journal: Path, extracted: Path) -> None:
    schema = pq.read_schema(extracted / "ravenstate.parquet")
    unit = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert unit["stamp"] == "ns"
    assert (unit["jpos:gold_insertion"], unit["jpos:green_elbow"]) == ("m", "rad")
    assert (unit["jvel:gold_insertion"], unit["pos:gold_x"], unit["encVals:gold_roll"]) == ("m/s", "m", "count")
    about = json.loads(schema.metadata[b"catenary"])
    assert (about["robot"], about["simulated"], about["seed"]) == (ABOUT.robot, True, ABOUT.seed)
    assert about["sources"][0]["sha256"] == sha256_of(journal / "0000.mcap")
    assert TopicFile(extracted / "ravenstate.parquet").about.simulated


@pytest.mark.parametrize("kind", ["bag", "mcap", "mcap file", "group of bags", "group of mcap"])
def test_every_kind_of_file_gives_the_same_numbers(journal, extracted, tmp_path, kind) -> None:
    if kind == "group of bags":
        write_group_bags(JournalReader(journal), tmp_path / "bags")
        paths = [tmp_path / "bags"]
    elif kind == "group of mcap":
        paths = [*write_group_bags(JournalReader(journal), tmp_path, "mcap")]
    else:
        paths = [write_bag(journal, tmp_path / ("a.bag" if kind == "bag" else "a"))]
        paths = list(paths[0].glob("*.mcap")) if kind == "mcap file" else paths
    result = extract(paths, tmp_path / "y")
    assert result.problems == ()
    assert result.about is not None
    assert result.about.simulated
    for topic in raven_topics():
        expected = _columns(extracted, topic.stem)
        got = _columns(tmp_path / "y", topic.stem)
        assert list(got) == list(expected)
        for name, values in expected.items():
            assert_array_equal(got[name], values, err_msg=name)


def test_memory_is_bounded_by_row_groups(journal, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(extract_module, "ROW_GROUP", 100)
    monkeypatch.setattr(sqlite_bag, "AT_ONCE", 100)
    extract([journal], tmp_path / "x")
    file = topic_file(tmp_path / "x", EXT_JPOS)
    assert file.row_groups > 3  # of 64 kB of messages of all topics, or of 100 rows
    parts = [file.read(["stamp"], group)["stamp"] for group in range(file.row_groups)]
    assert_array_equal(np.concatenate(parts), file.read(["stamp"])["stamp"])


def test_only_the_topics_asked_for_are_extracted(journal: Path, tmp_path: Path) -> None:
    result = extract([journal], tmp_path / "x", topics=["ext_jpos"])
    assert list(result.files) == ["/ext_jpos"]
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["ext_jpos.parquet"]


def test_a_topic_that_is_not_there_is_answered_with_those_that_are(journal: Path, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no topic /force; it has /ravenstate, /arm2"):
        extract([journal], tmp_path / "x", topics=["/force"])
    assert not (tmp_path / "x").exists()
    extract([journal], tmp_path / "y", topics=["ext_jpos"])
    with pytest.raises(FileFormatError, match="topics there: ext_jpos"):
        topic_file(tmp_path / "y", GREEN_MEASURED_JS)


def test_what_is_cut_off_is_extracted_and_the_loss_reported(journal: Path, tmp_path: Path) -> None:
    (tmp_path / "r").mkdir()
    whole = (journal / "0000.mcap").read_bytes()
    (tmp_path / "r" / "0000.mcap").write_bytes(whole[:-500])
    result = extract([tmp_path / "r"], tmp_path / "x")
    assert any("was not closed" in problem for problem in result.problems)
    assert result.messages["/ravenstate"] > 0
    whole = write_bag(journal, tmp_path / "a.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError, match="can be saved"):
        extract([tmp_path / "cut.bag"], tmp_path / "y")
    result = extract([tmp_path / "cut.bag"], tmp_path / "y", salvage=True)
    assert any("cut off" in problem for problem in result.problems)
    assert result.messages["/ravenstate"] > 100


def test_what_does_not_belong_together_or_is_no_topic_is_refused(tmp_path: Path, journal: Path) -> None:
    topics = [JournalTopic("/ext_jpos", EXT_JPOS.type)]
    JournalWriter(tmp_path / "other", topics, About("panda", False)).close()
    with pytest.raises(InputError, match=r"raven2 \(simulated\), panda \(real\)"):
        extract([journal, tmp_path / "other"], tmp_path / "x")
    JournalWriter(tmp_path / "text", [JournalTopic("/ext_jpos", "std_msgs/String")]).close()
    with pytest.raises(FileFormatError, match="/ext_jpos: expected sensor_msgs/JointState, got std_msgs/String"):
        extract([tmp_path / "text"], tmp_path / "x")
    (tmp_path / "ext_jpos.parquet").write_bytes(b"no parquet")
    with pytest.raises(FileFormatError, match="cannot be read as an extracted topic"):
        topic_file(tmp_path, EXT_JPOS)
    with pytest.raises(InputError, match="holds an extraction already"):
        extract([journal], tmp_path)


def test_a_full_disk_is_an_error_that_names_the_place_and_leaves_nothing(journal, tmp_path, monkeypatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr("pyarrow.parquet.ParquetWriter.write_table", full)
        with pytest.raises(FileFormatError, match=r"x: cannot be written: No space left on device"):
            extract([journal], tmp_path / "x")
    assert list((tmp_path / "x").iterdir()) == []
    with monkeypatch.context() as broken:
        broken.setattr("rosbags.rosbag1.Writer.write", full)
        with pytest.raises(FileFormatError, match=r"bags: bags cannot be written: No space left on device"):
            write_group_bags(JournalReader(journal), tmp_path / "bags")
    extract([journal], tmp_path / "x")
    write_raven_csv(tmp_path / "x", tmp_path / "x.csv")
    whole = (tmp_path / "x.csv").read_bytes()
    with monkeypatch.context() as broken:
        broken.setattr("pyarrow.csv.write_csv", full)
        with pytest.raises(FileFormatError, match=r"x\.csv: cannot be written: No space left on device"):
            write_raven_csv(tmp_path / "x", tmp_path / "x.csv")
    assert (tmp_path / "x.csv").read_bytes() == whole
