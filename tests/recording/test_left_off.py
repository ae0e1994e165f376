"""A recording that was cut off goes on: nothing twice, nothing missing but what was told."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.crtk.message_bytes import codec
from catenary.crtk.message_values import joint_state_message
from catenary.dvrk_psm import psm_topic
from catenary.errors import FileFormatError
from catenary.recording.bag_reader import JournalReader
from catenary.recording.journal import About, JournalTopic, JournalWriter
from catenary.trajectories.reference import GoneOn
from catenary.workflows.robot.topic_recorder import left_off
from oracles.waves import Waves

TOPICS = [JournalTopic("/a", "std_msgs/Bool"), JournalTopic("/b", "std_msgs/Float64")]
SECOND = 10**9


def appended(writer: JournalWriter, first: int, last: int) -> None:
    """Messages that come every 10 ms, numbered by their bytes."""
    for k in range(first, last):
        writer.append("/b", SECOND + k * 10**7, np.float64(k).tobytes())
        if k % 3 == 0:
            writer.append("/a", SECOND + k * 10**7 + 1, bytes([k % 256]))


def numbers(folder: Path) -> tuple[list[int], JournalReader]:
    reader = JournalReader(folder)
    return [int(np.frombuffer(data)[0]) for name, _, data in reader.messages() if name == "/b"], reader


@pytest.mark.alike
@pytest.mark.parametrize("end", ["closed", "torn", "empty file", "killed at once"])
@pytest.mark.parametrize("max_bytes", [2**26, 2**14])
def test_it_goes_on_from_the_last_whole_pass(tmp_path: Path, end: str, max_bytes: int) -> None:
    with JournalWriter(tmp_path, TOPICS, max_bytes=max_bytes) as writer:
        for part in range(3):
            if part:
                writer.begin_pass(10.0 * part)
            appended(writer, 1000 * part, 1000 * (part + 1) - (500 if part == 2 else 0))
    newest = max(tmp_path.glob("*.mcap"))
    if end == "torn":
        newest.write_bytes(newest.read_bytes()[: newest.stat().st_size // 2])
    elif end == "empty file":
        newest.with_name(f"{int(newest.stem) + 1:04d}.mcap").touch()
    elif end == "killed at once":
        newest.with_name(f"{int(newest.stem) + 1:04d}.mcap").write_bytes(newest.read_bytes()[:40])
    found = JournalReader(tmp_path).left_off(in_passes=True)
    assert found is not None
    assert found.begins == 20.0
    for file in found.dropped:
        file.unlink()
    with JournalWriter(tmp_path, TOPICS, after=found, max_bytes=max_bytes) as writer:
        writer.note(found.gap(found.last + 5 * SECOND))
        appended(writer, 2000, 3000)
    whole, reader = numbers(tmp_path)
    assert whole == list(range(3000))
    assert reader.lost == 0
    assert not reader.ends_early
    assert [remark for remark in reader.problems if "5.0 s later from 20.0 s" in remark]
    assert not reader.damage


@given(cuts=st.lists(st.floats(0.02, 0.98), min_size=1, max_size=4))
@settings(max_examples=25, deadline=None)
def test_wherever_it_is_cut_it_ends_whole(tmp_path_factory: pytest.TempPathFactory, cuts: list[float]) -> None:
    folder, begin, found = tmp_path_factory.mktemp("cut") / "train", 0, None
    for cut in [*cuts, None]:
        with JournalWriter(folder, TOPICS, after=found) as writer:
            end = 1000 if cut is None else begin + max(1, int(cut * (1000 - begin)))
            for k in range(begin, end):
                if k % 100 == 0 and k > begin:
                    writer.begin_pass(k / 100)
                appended(writer, k, k + 1)
        if cut is None:
            break
        newest = max(folder.glob("*.mcap"))
        data = newest.read_bytes()
        newest.write_bytes(data[: int(cut * len(data))])
        try:
            found = JournalReader(folder).left_off(in_passes=True)
        except FileFormatError:  # not one whole topic
            found = None
        if found is None:
            for file in folder.glob("*"):
                file.unlink()
            begin = 0
            continue
        for file in found.dropped:
            file.unlink()
        begin = round(100 * found.begins)
    assert numbers(folder)[0] == list(range(1000))


def test_who_moves_it_not_keeps_all_that_came(tmp_path: Path) -> None:
    with JournalWriter(tmp_path, TOPICS) as writer:
        appended(writer, 0, 730)
    found = JournalReader(tmp_path).left_off(in_passes=False)
    assert found is not None
    assert found.begins == pytest.approx(7.29, abs=1e-6)
    with JournalWriter(tmp_path, TOPICS, after=found) as writer:
        appended(writer, 2000, 2100)
    again = JournalReader(tmp_path).left_off(in_passes=False)
    assert again is not None
    assert again.begins == pytest.approx(7.29 + 0.99, abs=1e-6)  # what lies between the two counts not
    assert numbers(tmp_path)[0] == [*range(730), *range(2000, 2100)]


def test_what_is_of_another_kind_does_not_go_on(tmp_path: Path) -> None:
    topics = [psm_topic("/PSM1", "measured_js")]
    about = About(robot="dvrk_psm", configuration={"motion": {"sines": (1, 2.5)}})
    with JournalWriter(tmp_path / "a", [JournalTopic(topics[0].name, topics[0].type)], about) as writer:
        message = joint_state_message(("x",), 0, [0.0])
        writer.append(topics[0].name, 5 * SECOND, codec(topics[0].type).encode(message, 0))

    def found(about: About, now: int = 6 * SECOND) -> bool:
        return left_off(tmp_path / "a", about, topics, now, in_passes=False) is not None

    assert found(about)
    assert not found(About(robot="dvrk_psm", configuration={"motion": {"sines": (1, 3)}}))
    assert not found(About(robot="raven2", configuration=about.configuration))
    assert not found(about, 4 * SECOND)  # a clock that was set back
    assert left_off(tmp_path / "none", about, topics, 6 * SECOND, in_passes=True) is None


def test_a_motion_goes_on_from_rest_and_is_itself_from_the_instant_on() -> None:
    motion = Waves(20.0)
    went = GoneOn(motion, 7.3)
    assert np.abs(went(0.0).qd).max() == 0.0
    times = np.linspace(0.0, went.duration, 400)
    _, qd, qdd = went.sample(times)
    h = 1e-5
    inner = times[1:-1]
    before, after = went.sample(inner - h), went.sample(inner + h)
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), qd[1:-1], atol=1e-6)  # central difference
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), qdd[1:-1], atol=1e-3)
    later = times[times > went.lead]
    np.testing.assert_allclose(went.sample(later)[0], motion.sample(later - went.lead + 7.3)[0], atol=1e-12)
    assert went.duration == pytest.approx(motion.duration - 7.3 + went.lead)
    np.testing.assert_array_equal(GoneOn(motion, 0.0).sample(times[:50])[0], motion.sample(times[:50])[0])
