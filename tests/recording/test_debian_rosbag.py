"""Bags of ours in the hands of Debian's rosbag, and bags of its in ours; skipped where it is not installed."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from catenary.recording.bag_reader import open_recording
from catenary.recording.bag_writer import write_group_bags
from catenary.recording.import_formats.sources import Sources
from catenary.recording.journal_reader import JournalReader
from oracles.raven_recording import record

PYTHON = "/usr/bin/python3"  # the one that Debian's packages are for
# as a recorder does: raw bytes, with the type's own sum and definition
REWRITE = """
import sys, rosbag
with rosbag.Bag(sys.argv[1]) as old, rosbag.Bag(sys.argv[2], "w", compression=sys.argv[3], chunk_threshold=20000) as new:
    for topic, raw, stamp, header in old.read_messages(raw=True, return_connection_header=True):
        new.write(topic, raw, stamp, raw=True, connection_header=header)
"""
# the numbers as genpy reads them, with classes made from the definition in the bag
READ = """
import json, sys, rosbag
with rosbag.Bag(sys.argv[1]) as bag:
    print(json.dumps([
        [topic, stamp.to_nsec(), (message.hdr if hasattr(message, "hdr") else message.header).stamp.to_nsec(),
         list(message.jpos if hasattr(message, "jpos") else message.position)]
        for topic, message, stamp in bag.read_messages() if not hasattr(message, "data")]))
"""


def by_debian(*arguments: str) -> str:
    """Output of a program that must succeed."""
    done = subprocess.run([PYTHON, *arguments], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module", autouse=True)
def rosbag() -> str:
    """The command."""
    found = shutil.which("rosbag")
    if found is None or subprocess.run([PYTHON, "-c", "import rosbag"], capture_output=True).returncode != 0:
        pytest.skip("Debian's rosbag is not installed: apt install python3-rosbag")
    return found


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("recording") / "journal", 5.0)


@pytest.fixture(scope="module")
def ours(journal: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Bags by name."""
    written = write_group_bags(JournalReader(journal), tmp_path_factory.mktemp("bags"))
    return {path.stem: path for path in written}


def test_rosbag_reads_the_numbers_that_we_wrote(ours: dict[str, Path]) -> None:
    degrees = json.loads(by_debian("-c", READ, str(ours["record_ravenstate"])))
    state = Sources([ours["record_ravenstate"]]).read({"/ravenstate": ["jpos[gold_shoulder]"]})["/ravenstate"]
    assert [row[1] for row in degrees] == state.arrival.tolist()
    assert [row[2] for row in degrees] == state.stamp.tolist()
    shoulder = np.deg2rad([row[3][0] for row in degrees])
    np.testing.assert_allclose(state.columns["jpos[gold_shoulder]"], shoulder, rtol=1e-12)


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_a_bag_of_rosbags_holds_the_same_messages(ours, tmp_path, compression) -> None:
    rewritten = {path: tmp_path / path.name for path in ours.values()}
    for path, to in rewritten.items():
        by_debian("-c", REWRITE, str(path), str(to), compression)
        mine, theirs = open_recording(path), open_recording(to)
        assert list(mine.messages()) == list(theirs.messages())
        assert theirs.problems == []
        assert theirs.about == mine.about
