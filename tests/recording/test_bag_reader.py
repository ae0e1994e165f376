"""Bags that are read back whole or damaged, and what of them is said to be lost."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from catenary.errors import FileFormatError
from catenary.recording.bag_reader import Hole, JournalReader, Rescue, TopicLoss, open_recording
from catenary.recording.bag_stream import BagStream
from catenary.recording.layout import ABOUT_TOPIC
from oracles.raven_recording import ABOUT, record, write_bag

Message = tuple[str, int, bytes]


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute of a RAVEN: more than three chunks of a bag."""
    return record(tmp_path_factory.mktemp("recording") / "journal", 35.0)


@pytest.fixture(scope="module")
def sent(journal: Path) -> list[Message]:
    return list(JournalReader(journal).messages())


@pytest.fixture(scope="module")
def bags(journal: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same as a file of each kind."""
    folder = tmp_path_factory.mktemp("bags")
    (mcap,) = write_bag(journal, folder / "a").glob("*.mcap")
    return {"ros1": write_bag(journal, folder / "a.bag"), "mcap": mcap}


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_robot_seed_and_simulated_travel_with_the_bag(bags: dict[str, Path], kind: str) -> None:
    source = open_recording(bags[kind])
    assert (source.about.robot, source.about.simulated, source.about.seed) == ("raven2", True, ABOUT.seed)
    assert ABOUT_TOPIC not in [topic.name for topic in source.topics]


@pytest.mark.parametrize("share", [0.3, 0.7, 0.95, 0.9999])
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_what_is_whole_of_a_truncated_bag_is_read_and_that_it_was_cut_off_is_said(
    bags, sent, tmp_path, kind, share
) -> None:
    whole = bags[kind].read_bytes()
    cut = tmp_path / f"cut{bags[kind].suffix}"
    cut.write_bytes(whole[: int(share * len(whole))])
    source = open_recording(cut)
    assert "cut off" in source.problems[-1]
    saved = [(t, s) for t, s, _ in source.messages()]
    assert saved == [(t, s) for t, s, _ in sent][: len(saved)]  # the first ones, none between lost
    assert len(saved) > (share - 0.1) * len(sent)
    assert sum(source.counts.values()) == len(saved)
    assert source.about is not None


@pytest.mark.parametrize("closed", [True, False])
def test_a_bag_without_its_index_is_read_whole_and_said(bags, sent, tmp_path, closed) -> None:
    written, whole = tmp_path / "a.bag", bags["ros1"].read_bytes()
    place = whole.index(b"index_pos=") + len(b"index_pos=")
    begin = int.from_bytes(whole[place : place + 8], "little")
    if not closed:  # a recorder fills this in when it closes the bag
        whole = whole[:place] + bytes(8) + whole[place + 8 :]
    written.write_bytes(whole[:begin])
    source = open_recording(written)
    assert [(t, s) for t, s, _ in source.messages()] == [(t, s) for t, s, _ in sent]
    assert "lacks its index" in source.problems[-1]


def test_a_topic_of_an_unknown_type_is_listed(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Temperature", typestore=store)
        writer.write(connection, 1, b"\0" * 32)
    reader = open_recording(tmp_path / "a.bag")
    assert [(t.name, t.type) for t in reader.topics] == [("/imu", "sensor_msgs/Temperature")]


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such recording"):
        open_recording(tmp_path / "a.bag")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(FileFormatError, match=r"expected a journal, a \.bag"):
        open_recording(tmp_path / "notes.txt")


@pytest.fixture(scope="module", params=["ros1", "bz2", "mcap"])
def bag(request: pytest.FixtureRequest, journal: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    if request.param == "mcap":
        (mcap,) = write_bag(journal, folder / "a").glob("*.mcap")
        return mcap
    return write_bag(journal, *((folder / "a.bag",) if request.param == "ros1" else (folder / "packed.bag", "BZ2")))


@pytest.mark.parametrize("seed", range(4))
def test_damage_in_the_middle_costs_its_chunk_at_most_and_is_counted(bag: Path, sent, tmp_path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    content = bytearray(bag.read_bytes())
    size = (1, 30, 3000, 100_000)[seed] if bag.name == "a.bag" else 3000
    place = int(rng.integers(0.3 * len(content), 0.5 * len(content)))
    content[place : place + size] = rng.bytes(size)
    hit = tmp_path / bag.name
    hit.write_bytes(content)
    stream = BagStream(hit)
    kept = [message[:2] for message in stream.messages()]
    there, found = Counter((t, s) for t, s, _ in sent), set(kept)
    missing = sum((there - Counter(kept)).values())
    assert missing < 0.45 * len(sent)
    assert [one for one in kept if one in there] == [(t, s) for t, s, _ in sent if (t, s) in found]
    if missing == 0:
        return  # within a message's own bytes, which no checksum guards
    assert stream.damage
    arrivals = {t.name: np.array([s for name, s in kept if name == t.name]) for t in stream.topics}
    rescue = Rescue.of(arrivals, stream.holes, ends_early=stream.ends_early)
    lost = sum(one.lost for one in rescue.topics)
    assert abs(lost - missing) <= 0.1 * missing + 4  # a jitter of 5 %, rounded for each topic
    assert "lost: about" in rescue.text()


def test_what_is_lost_is_told_by_each_topics_own_rate() -> None:
    second = 1_000_000_000
    fast, slow = second // 100 * np.arange(1000), second // 10 * np.arange(100)
    hole = (3 * second, 5 * second)
    cut = {"/fast": fast[(fast <= hole[0]) | (fast >= hole[1])], "/slow": slow[(slow <= hole[0]) | (slow >= hole[1])]}

    def losses(arrivals: dict[str, np.ndarray], holes: list[Hole]) -> tuple[TopicLoss, ...]:
        return Rescue.of(arrivals, holes, ends_early=False).topics

    found = {one.topic: one for one in losses(cut, [hole])}
    assert (found["/fast"].lost, found["/slow"].lost) == (199, 19)
    assert found["/fast"].seconds == pytest.approx(1.99)
    assert all(one.lost == 0 for one in losses(cut, []))
    assert [one.lost for one in losses({"/once": fast[:1], "/none": fast[:0]}, [hole])] == [0, 0]
    ended = losses({"/a": fast[:500], "/b": fast}, [(int(fast[499]), None)])
    assert [one.lost for one in ended] == [500, 0]
