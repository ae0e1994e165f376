"""Bags that are damaged in the middle, and what of them is said to be lost."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from catenary.recording.bag_reader import Hole, JournalReader, Rescue, TopicLoss
from catenary.recording.bag_stream import BagStream
from oracles.raven_recording import record, write_bag

Message = tuple[str, int, bytes]


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More than three chunks of a bag."""
    return record(tmp_path_factory.mktemp("recording") / "journal", 35.0)


@pytest.fixture(scope="module")
def sent(journal: Path) -> list[Message]:
    return list(JournalReader(journal).messages())


@pytest.fixture(scope="module", params=["ros1", "bz2", "mcap"])
def bag(request: pytest.FixtureRequest, journal: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    if request.param == "mcap":
        (mcap,) = write_bag(journal, folder / "a").glob("*.mcap")
        return mcap
    return write_bag(journal, *((folder / "a.bag",) if request.param == "ros1" else (folder / "packed.bag", "BZ2")))


@pytest.mark.alike
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
