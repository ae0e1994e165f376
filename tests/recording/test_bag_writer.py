"""Bags that are written, read back whole or damaged, and what of them is said to be lost."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from catenary.errors import FileFormatError, InputError
from catenary.recording.bag_reader import Hole, JournalReader, Rescue, TopicLoss, open_recording, open_recordings
from catenary.recording.bag_stream import BagStream
from catenary.recording.bag_writer import write_group_bags
from catenary.recording.layout import ABOUT_TOPIC
from catenary.recording.messages import full_definition, md5_sum, typestore
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


def _by_rosbags(*paths: Path) -> Iterator[tuple[str, int, bytes, Any]]:
    with AnyReader(paths) as reader:  # checks the definitions against their sums, too
        for connection, stamp, data in reader.messages():
            if connection.topic != ABOUT_TOPIC:
                yield connection.topic, stamp, bytes(data), reader.deserialize(data, connection.msgtype)


def test_mcap_holds_the_same_messages_in_cdr(journal, bags, sent, tmp_path) -> None:
    written = write_group_bags(JournalReader(journal), tmp_path / "a", "mcap")
    read = sorted(_by_rosbags(*written), key=lambda message: (message[1], message[0]))
    for (topic, stamp, _, message), (sent_topic, sent_stamp, data) in zip(
        read, sorted(sent, key=lambda m: (m[1], m[0])), strict=True
    ):
        assert (topic, stamp) == (sent_topic, sent_stamp)
        name = message.__msgtype__
        original = typestore(1).deserialize_ros1(data, name)
        for field in ("jpos", "tau", "encVals", "pos") if name.endswith("state") else ("position", "name"):
            np.testing.assert_array_equal(getattr(message, field), getattr(original, field))
        header = "hdr" if name.endswith("state") else "header"
        assert vars(getattr(message, header).stamp) == vars(getattr(original, header).stamp)
    written = write_group_bags(open_recording(bags["mcap"]), tmp_path / "back")
    back = sorted(message for source in open_recordings(written) for message in source.messages())
    # ROS 2 has no seq, the first four bytes of a header
    assert [(t, s, d[4:]) for t, s, d in back] == [(t, s, d[4:]) for t, s, d in sorted(sent)]


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_robot_seed_and_simulated_travel_with_the_bag(bags: dict[str, Path], kind: str) -> None:
    source = open_recording(bags[kind])
    assert (source.about.robot, source.about.simulated, source.about.seed) == ("raven2", True, ABOUT.seed)
    assert ABOUT_TOPIC not in [topic.name for topic in source.topics]


def test_one_bag_per_topic_as_the_group_records(journal: Path, sent: list[Message], tmp_path: Path) -> None:
    written = write_group_bags(JournalReader(journal), tmp_path)
    of_topics = ("ravenstate", "CRTKmeasurejs", "ext_jenc", "joint_enc", "about")
    assert [path.name for path in written] == [f"record_{name}.bag" for name in of_topics]
    for path in written:
        with AnyReader([path]) as reader:
            # RAVEN's group reads them with rosbag's read_messages() and takes all that comes for that topic
            (connection,) = reader.connections
            assert {each.topic for each, _, _ in reader.messages()} == {connection.topic}
            name = connection.msgtype.replace("/msg/", "/")
            assert connection.digest == md5_sum(name)
            assert connection.msgdef.data == full_definition(name)
    assert sorted(message[:3] for message in _by_rosbags(*written)) == sorted(sent)
    sources = open_recordings([tmp_path])
    assert sorted(m for source in sources for m in source.messages()) == sorted(sent)
    stated = [source.about for source in sources if source.about is not None]
    assert [(about.robot, about.seed) for about in stated] == [(ABOUT.robot, ABOUT.seed)]
    with pytest.raises(InputError, match="never overwritten"):
        write_group_bags(JournalReader(journal), tmp_path)


def test_what_a_torn_journal_lost_is_logged_when_a_bag_is_made(journal, tmp_path, caplog) -> None:
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn/0000.mcap").write_bytes((journal / "0000.mcap").read_bytes()[:-300])
    write_group_bags(JournalReader(tmp_path / "torn/0000.mcap"), tmp_path / "bags")
    assert "lacks its index" in caplog.text


def test_what_cannot_be_finished_is_told_by_its_folder(journal: Path, tmp_path: Path) -> None:
    class Failing(JournalReader):
        def messages(self, topics: object = None) -> Iterator[Message]:
            yield from list(super().messages())[:10]
            raise OSError("gone")

    with pytest.raises(FileFormatError, match="bags cannot be written: gone"):
        write_group_bags(Failing(journal), tmp_path)


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


def test_another_version_of_a_type_is_not_written_as_ours_and_the_difference_is_told(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("Header hdr\nint32 runlevel\nfloat64[16] jpos\n", "raven_2/msg/raven_state"))
    with Writer1(tmp_path / "a.bag") as writer:
        writer.add_connection("/ravenstate", "raven_2/msg/raven_state", typestore=store)
        writer.write(writer.connections[0], 1, b"\0" * 148)
    with pytest.raises(FileFormatError, match="differs from the type that catenary knows") as caught:
        write_group_bags(open_recording(tmp_path / "a.bag"), tmp_path / "out")
    assert "float32[16] jpos" in str(caught.value)
    assert "has besides [float64[16] jpos]" in str(caught.value)
    store = get_typestore(Stores.LATEST)
    store.register(get_types_from_msg("std_msgs/Header header\nstring state\n", "crtk_msgs/msg/OperatingState"))
    with Writer2(tmp_path / "a", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/operating_state", "crtk_msgs/msg/OperatingState", typestore=store)
    with pytest.raises(FileFormatError, match=r"lacks \[bool is_homed, bool is_busy\]"):
        write_group_bags(open_recording(tmp_path / "a"), tmp_path / "out")


def test_a_topic_of_an_unknown_type_is_listed_but_not_copied(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Temperature", typestore=store)
        writer.write(connection, 1, b"\0" * 32)
    reader = open_recording(tmp_path / "a.bag")
    assert [(t.name, t.type) for t in reader.topics] == [("/imu", "sensor_msgs/Temperature")]
    with pytest.raises(InputError, match="Temperature is not known"):
        write_group_bags(reader, tmp_path / "b")


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
